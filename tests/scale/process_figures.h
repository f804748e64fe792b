// Figures of a process by the kernel (Linux).
#pragma once

#include <sys/types.h>

#include <cstdint>

namespace candela::scale {

struct ProcessFigures {
  double cpu_seconds = 0;  // user and system, of all threads
  std::uint64_t resident_bytes = 0, peak_resident_bytes = 0;
  unsigned threads = 0, open_files = 0;
};
// Zeros if there is no such process.
ProcessFigures figures_of(pid_t pid);

}  // namespace candela::scale
