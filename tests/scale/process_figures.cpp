#include "tests/scale/process_figures.h"

#include <fmt/format.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>

namespace candela::scale {

ProcessFigures figures_of(pid_t pid) {
  ProcessFigures out;
  const std::string folder = fmt::format("/proc/{}", pid);
  std::ifstream stat(folder + "/stat");
  const std::string text{std::istreambuf_iterator<char>(stat), {}};
  if (text.empty()) return out;
  std::istringstream fields(text.substr(text.rfind(')') + 1));
  std::string word;
  for (int i = 3; i < 14; ++i) fields >> word;  // fields 3 to 13 of proc(5)
  double user = 0, system = 0;
  fields >> user >> system;
  out.cpu_seconds = (user + system) / static_cast<double>(::sysconf(_SC_CLK_TCK));
  std::ifstream status(folder + "/status");
  for (std::string name; status >> name;) {
    std::uint64_t value = 0;
    if (name == "VmRSS:" && status >> value) out.resident_bytes = value << 10;
    if (name == "VmHWM:" && status >> value) out.peak_resident_bytes = value << 10;
    if (name == "Threads:" && status >> value) out.threads = static_cast<unsigned>(value);
  }
  std::error_code code;
  for (auto it = std::filesystem::directory_iterator(folder + "/fd", code);
       !code && it != std::filesystem::directory_iterator(); it.increment(code))
    ++out.open_files;
  return out;
}

}  // namespace candela::scale
