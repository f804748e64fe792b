// The one logger: spdlog to stderr, as text or as one JSON object a line. Ids of job, unit and worker are
// fields, so that they can be searched for on every line.
#pragma once

#include <cstdint>
#include <string_view>

#include "common/base/result.h"

namespace candela::log {

// level: trace, debug, info, warn, error, off. format: text, json. `program` is a field of every JSON line.
Result<void> initialise(std::string_view program, std::string_view level, std::string_view format);

enum class Level : std::uint8_t { debug, info, warn, error };

// Subject of a line; use as: log::info("merged", {.job = id, .unit = 7}).
struct Ids {
  std::string_view job = {};
  std::int64_t unit = -1;
  std::string_view worker = {};
};

// In JSON format the ids become fields of the object; in text they follow the message.
void write(Level level, std::string_view message, const Ids& ids = {});
inline void debug(std::string_view m, const Ids& ids = {}) {
  write(Level::debug, m, ids);
}
inline void info(std::string_view m, const Ids& ids = {}) {
  write(Level::info, m, ids);
}
inline void warn(std::string_view m, const Ids& ids = {}) {
  write(Level::warn, m, ids);
}
inline void error(std::string_view m, const Ids& ids = {}) {
  write(Level::error, m, ids);
}
// All lines written so far are out.
void flush();

}  // namespace candela::log
