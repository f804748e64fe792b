#include "tests/bench/candela_bench/machine.h"

#include <sched.h>
#include <stdlib.h>
#include <time.h>

#include <array>
#include <fstream>
#include <sstream>

namespace candela::bench {
namespace {

// The text after the colon in the first line that starts with `key`.
std::string field_of(const char* file, const std::string& key) {
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    if (!line.starts_with(key)) continue;
    const auto colon = line.find(':');
    const auto first = line.find_first_not_of(" \t", colon + 1);
    if (colon != std::string::npos && first != std::string::npos) return line.substr(first);
  }
  return "";
}

}  // namespace

Machine this_machine() {
  Machine machine;
  machine.cpu = field_of("/proc/cpuinfo", "model name");
  cpu_set_t allowed;
  if (::sched_getaffinity(0, sizeof allowed, &allowed) == 0)
    machine.cores = static_cast<unsigned>(CPU_COUNT(&allowed));
  std::uint64_t kibibytes = 0;
  if (std::istringstream(field_of("/proc/meminfo", "MemTotal")) >> kibibytes)
    machine.memory_bytes = kibibytes * 1024;
  double load = 0;
  if (::getloadavg(&load, 1) == 1) machine.load_at_start = load;
  const time_t now = ::time(nullptr);
  tm utc{};
  std::array<char, 32> text{};
  if (::gmtime_r(&now, &utc) != nullptr &&
      ::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &utc) != 0)
    machine.started = text.data();
#ifdef __clang__
  machine.compiler = "clang " __VERSION__;
#else
  machine.compiler = "gcc " __VERSION__;
#endif
  return machine;
}

}  // namespace candela::bench
