#include "common/base/log.h"

#include <fmt/format.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <atomic>

#include "common/base/text.h"

namespace candela::log {
namespace {

std::atomic<bool> json_format{false};  // set once at start, before any thread logs

// Every text of a line passes here: a name from elsewhere can neither end a line nor reach the terminal.
std::string field(std::string_view text) {
  std::string line = escape_unprintable(text);
  if (!json_format) return line;
  std::string quoted;
  quoted.reserve(line.size() + 8);
  for (const char c : line) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return quoted;
}

constexpr spdlog::level::level_enum spdlog_level(Level level) {
  switch (level) {
    case Level::debug:
      return spdlog::level::debug;
    case Level::info:
      return spdlog::level::info;
    case Level::warn:
      return spdlog::level::warn;
    case Level::error:
      break;
  }
  return spdlog::level::err;
}

}  // namespace

Result<void> initialise(std::string_view program, std::string_view level, std::string_view format) {
  const auto parsed = spdlog::level::from_str(std::string(level));
  if (parsed == spdlog::level::off && level != "off")
    return usage_error(fmt::format("unknown log level '{}'", level))
        .with_field("--log-level")
        .with_mend("use trace, debug, info, warn, error or off");
  if (format != "text" && format != "json")
    return usage_error(fmt::format("unknown log format '{}'", format))
        .with_field("--log-format")
        .with_mend("use text or json");
  json_format = format == "json";
  auto logger = std::make_shared<spdlog::logger>(std::string(program),
                                                 std::make_shared<spdlog::sinks::stderr_color_sink_mt>());
  logger->set_level(parsed);
  logger->flush_on(spdlog::level::trace);
  if (json_format)
    logger->set_pattern(R"({"time":"%Y-%m-%dT%H:%M:%S.%e%z","level":"%l","program":"%n",%v})");
  else
    logger->set_pattern("%Y-%m-%d %H:%M:%S.%e %^%l%$ %v");
  spdlog::set_default_logger(std::move(logger));
  return {};
}

void write(Level level, std::string_view message, const Ids& ids) {
  if (!spdlog::should_log(spdlog_level(level))) return;
  std::string text;
  if (json_format) {
    text = fmt::format(R"("message":"{}")", field(message));
    if (!ids.job.empty()) text += fmt::format(R"(,"job":"{}")", field(ids.job));
    if (ids.unit >= 0) text += fmt::format(R"(,"unit":{})", ids.unit);
    if (!ids.worker.empty()) text += fmt::format(R"(,"worker":"{}")", field(ids.worker));
  } else {
    text = field(message);
    if (!ids.job.empty()) text += fmt::format(" job={}", field(ids.job));
    if (ids.unit >= 0) text += fmt::format(" unit={}", ids.unit);
    if (!ids.worker.empty()) text += fmt::format(" worker={}", field(ids.worker));
  }
  spdlog::log(spdlog_level(level), "{}", text);
}

void flush() {
  spdlog::default_logger()->flush();
}

}  // namespace candela::log
