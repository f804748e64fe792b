// The machine and the program a row was made with.
#pragma once

#include <cstdint>
#include <string>

namespace candela::bench {

struct Machine {
  std::string cpu;     // model
  unsigned cores = 0;  // that this process may use
  std::uint64_t memory_bytes = 0;
  double load_at_start = 0;  // of the last minute, when the program started
  std::string started;       // UTC, "2026-11-21T20:15:03Z"
  std::string compiler;
};
// Unknown facts are empty or 0.
Machine this_machine();

}  // namespace candela::bench
