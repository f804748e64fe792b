#include "common/base/log.h"

#include <fmt/format.h>
#include <spdlog/sinks/stdout_color_sinks.h>

#include <atomic>

namespace candela::log {
namespace {

std::atomic<bool> json_format{false};  // set once at start, before any thread logs

std::string json_escape(std::string_view text) {
  std::string out;
  out.reserve(text.size() + 8);
  for (char c : text) {
    switch (c) {
      case '"':
        out += "\\\"";
        break;
      case '\\':
        out += "\\\\";
        break;
      case '\n':
        out += "\\n";
        break;
      default:
        if (static_cast<unsigned char>(c) < 0x20)
          out += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
        else
          out += c;
    }
  }
  return out;
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

void write(spdlog::level::level_enum level, std::string_view message, const Ids& ids) {
  if (!spdlog::should_log(level)) return;
  std::string text;
  if (json_format) {
    text = fmt::format(R"("message":"{}")", json_escape(message));
    if (!ids.job.empty()) text += fmt::format(R"(,"job":"{}")", json_escape(ids.job));
    if (ids.unit >= 0) text += fmt::format(R"(,"unit":{})", ids.unit);
    if (!ids.worker.empty()) text += fmt::format(R"(,"worker":"{}")", json_escape(ids.worker));
  } else {
    text = message;
    if (!ids.job.empty()) text += fmt::format(" job={}", ids.job);
    if (ids.unit >= 0) text += fmt::format(" unit={}", ids.unit);
    if (!ids.worker.empty()) text += fmt::format(" worker={}", ids.worker);
  }
  spdlog::log(level, "{}", text);
}

}  // namespace candela::log
