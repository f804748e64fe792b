// Checks of `candela doctor`. Each check tells what is there, whether it is fit, and if not what to do.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/farm_client.h"

namespace candela::client {

struct Diagnosis {
  enum class State { ok, skipped, warning, broken };
  std::string name;
  State state = State::ok;
  std::string text;
  std::string mend;  // what to do; empty if nothing is wrong
};
std::string_view name(Diagnosis::State state);

Diagnosis check_program();
Diagnosis check_system();
Diagnosis check_processor(const std::vector<std::string>& isas);
Diagnosis check_open_files();
// Checks that image files can be read and written.
Diagnosis check_images();

// Bytes of the machine or of this process's control group, whichever are fewer.
struct Memory {
  std::uint64_t total = 0, available = 0;  // 0: unknown
};
// `meminfo`: the text of /proc/meminfo. `limit`, `used`: of the control group; nothing if it has no limit.
Memory read_memory(std::string_view meminfo, std::optional<std::uint64_t> limit, std::uint64_t used);
Diagnosis check_memory(const Memory& memory);
Diagnosis check_memory();

// A folder that is written to, or its nearest parent that exists. `asked`: the user named it, so that a
// folder which cannot be written to is broken; other folders may belong to another user's service.
Diagnosis check_folder(const std::string& name, const std::filesystem::path& folder, bool asked);

// For which `days` are left, at `text`. Negative: expired.
Diagnosis check_expiry(const std::string& name, double days, const std::string& text);
// Our certificate and the authority's: when they expire, and whether the one is signed by the other.
std::vector<Diagnosis> check_certificates(const ConnectionOptions& connection);

// `ahead_seconds`: the master's clock less ours, known to within `uncertain_seconds`.
Diagnosis check_clock(double ahead_seconds, double uncertain_seconds);
// The master's answer, its clock, its workers.
std::vector<Diagnosis> check_farm(const ConnectionOptions& connection);

}  // namespace candela::client
