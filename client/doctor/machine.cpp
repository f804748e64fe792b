// The program and the machine it runs on.
#include <fmt/format.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/statvfs.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <sstream>
#include <thread>

#include "client/doctor/checks.h"
#include "client/values.h"
#include "common/base/enum_names.h"
#include "common/base/version.h"
#include "common/image/formats.h"

namespace candela::client {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMiB = 1 << 20, kGiB = 1 << 30;
constexpr std::uint64_t kLowMemory = kGiB;
constexpr std::uint64_t kNoRoom = 64 * kMiB, kLittleRoom = 2 * kGiB;
constexpr rlim_t kFewFiles = 1024;

// Empty if it cannot be read.
std::string read_text(const fs::path& path) {
  std::ifstream in(path);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view blanks = " \t\"";
  const std::size_t begin = text.find_first_not_of(blanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(blanks) + 1 - begin);
}

// The value of the first line "key<separator>value"; empty if there is none.
std::string line_value(std::string_view text, std::string_view key, char separator) {
  std::istringstream lines{std::string(text)};
  for (std::string line; std::getline(lines, line);) {
    const std::string_view whole = line;
    const std::size_t at = whole.find(separator);
    if (at != std::string_view::npos && trimmed(whole.substr(0, at)) == key)
      return std::string(trimmed(whole.substr(at + 1)));
  }
  return {};
}

std::optional<std::uint64_t> number_at(std::string_view text) {
  std::uint64_t value = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  return code == std::errc() ? std::optional(value) : std::nullopt;
}

// A file of this process's control group (version 2).
std::string group_file(const char* name) {
  const std::string line = read_text("/proc/self/cgroup");
  if (!line.starts_with("0::/")) return {};
  const fs::path group = fs::path("/sys/fs/cgroup") / line.substr(4, line.find('\n') - 4);
  return read_text(group / name);
}

unsigned usable_processors() {
  cpu_set_t set;
  CPU_ZERO(&set);
  if (::sched_getaffinity(0, sizeof set, &set) == 0) return static_cast<unsigned>(CPU_COUNT(&set));
  return std::thread::hardware_concurrency();
}

}  // namespace

std::string_view name(Diagnosis::State state) {
  return name_of_value<Diagnosis::State::broken>({"ok", "skipped", "warning", "broken"}, state, "broken");
}

Diagnosis check_program() {
  return {"program",
          Diagnosis::State::ok,
          fmt::format("candela {}, build {}, protocol {}", version(), build_id(), kProtocol),
          {}};
}

Diagnosis check_system() {
  struct utsname system {};
  std::string text = "unknown";
  if (::uname(&system) == 0) text = fmt::format("{} {} {}", system.sysname, system.release, system.machine);
  const std::string distribution = line_value(read_text("/etc/os-release"), "PRETTY_NAME", '=');
  if (!distribution.empty()) text += ", " + distribution;
  return {"system", Diagnosis::State::ok, printable(text), {}};
}

Diagnosis check_processor(const std::vector<std::string>& isas) {
  const std::string model = line_value(read_text("/proc/cpuinfo"), "model name", ':');
  const long online = ::sysconf(_SC_NPROCESSORS_ONLN);
  Diagnosis check{"processor",
                  Diagnosis::State::ok,
                  fmt::format("{}, {} of {} processors usable, instruction sets {}",
                              model.empty() ? "unknown model" : printable(model), usable_processors(), online,
                              join(isas, " ")),
                  {}};
  if (std::find(isas.begin(), isas.end(), "avx2") == isas.end()) {
    check.state = Diagnosis::State::warning;
    check.mend = "jobs ask for avx2 by default: submit with --isa " +
                 (isas.empty() ? std::string("sse2") : isas.back()) + " to use this machine";
  }
  return check;
}

Diagnosis check_open_files() {
  struct rlimit limit {};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0)
    return {"open files", Diagnosis::State::skipped, "unknown", {}};
  if (limit.rlim_cur == RLIM_INFINITY) return {"open files", Diagnosis::State::ok, "no limit", {}};
  Diagnosis check{"open files", Diagnosis::State::ok, fmt::format("at most {}", limit.rlim_cur), {}};
  if (limit.rlim_cur < kFewFiles) {
    check.state = Diagnosis::State::warning;
    check.mend = fmt::format(
        "ulimit -n {}, or LimitNOFILE of the service: a master holds a file for each "
        "connection",
        kFewFiles);
  }
  return check;
}

Diagnosis check_images() {
  const auto codec = image::image_codec();
  if (!codec.ok()) return {"images", Diagnosis::State::broken, codec.error().message, codec.error().mend};
  return {"images",
          Diagnosis::State::ok,
          fmt::format("by {}, {}", image::image_libraries(), (*codec)->library()),
          {}};
}

Memory read_memory(std::string_view meminfo, std::optional<std::uint64_t> limit, std::uint64_t used) {
  Memory memory;
  memory.total = number_at(line_value(meminfo, "MemTotal", ':')).value_or(0) * 1024;
  memory.available = number_at(line_value(meminfo, "MemAvailable", ':')).value_or(0) * 1024;
  if (limit && (memory.total == 0 || *limit < memory.total)) {
    memory.total = *limit;
    const std::uint64_t left = *limit - std::min(*limit, used);
    memory.available = memory.available == 0 ? left : std::min(memory.available, left);
  }
  return memory;
}

Diagnosis check_memory(const Memory& memory) {
  if (memory.total == 0) return {"memory", Diagnosis::State::skipped, "unknown", {}};
  Diagnosis check{"memory",
                  Diagnosis::State::ok,
                  fmt::format("{}, of which {} are available", format_bytes(memory.total),
                              format_bytes(memory.available)),
                  {}};
  if (memory.available < kLowMemory) {
    check.state = Diagnosis::State::warning;
    check.mend = "end other programs, or give --texture-memory a smaller size: scenes may not fit";
  }
  return check;
}

Diagnosis check_memory() {
  return check_memory(read_memory(read_text("/proc/meminfo"), number_at(group_file("memory.max")),
                                  number_at(group_file("memory.current")).value_or(0)));
}

Diagnosis check_folder(const std::string& name, const fs::path& folder, bool asked) {
  const std::string shown = printable(folder.string());
  const auto wrong = [&](std::string text, std::string mend) {
    return Diagnosis{name, asked ? Diagnosis::State::broken : Diagnosis::State::warning, std::move(text),
                     std::move(mend)};
  };
  std::error_code code;
  fs::path there = fs::absolute(folder, code);
  while (!fs::exists(there, code) && there != there.parent_path()) there = there.parent_path();
  if (!fs::is_directory(there, code))
    return wrong(fmt::format("{}: {} is no folder", shown, printable(there.string())),
                 "name another folder, or move the file away");
  struct statvfs disk {};
  if (::statvfs(there.c_str(), &disk) != 0)
    return wrong(fmt::format("{}: the disk cannot be asked", shown), "look at the mount of this folder");
  const std::uint64_t left = std::uint64_t{disk.f_bavail} * disk.f_frsize;
  const std::string room = fmt::format("{}: {} of {} are free{}", shown, format_bytes(left),
                                       format_bytes(std::uint64_t{disk.f_blocks} * disk.f_frsize),
                                       fs::exists(folder, code) ? "" : "; it will be created");
  if (::access(there.c_str(), W_OK | X_OK) != 0)
    return wrong(fmt::format("{}: this user cannot write there", shown),
                 "run as the user of the service, or give this user the folder");
  if (left < kNoRoom) return wrong(room, "make room on this disk: checkpoints and scene files need it");
  if (left < kLittleRoom)
    return {name, Diagnosis::State::warning, room, "make room on this disk before long renders"};
  return {name, Diagnosis::State::ok, room, {}};
}

}  // namespace candela::client
