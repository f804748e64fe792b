#include "client/help/integrator_help.h"

#include <fmt/format.h>

#include <limits>

#include "client/help/wrap.h"

namespace candela::client {

std::string integrator_help(const std::string& integrator, const std::vector<IntegratorSetting>& settings,
                            std::optional<std::size_t> width) {
  constexpr std::size_t kIndent = 6;
  std::string out =
      fmt::format("Settings of the integrator {}, for --set NAME=VALUE or the scene:\n", integrator);
  if (settings.empty()) out += "\n  none\n";
  for (const IntegratorSetting& setting : settings) {
    out += fmt::format("\n  {} ({}; default {})\n", setting.name, setting.type,
                       setting.default_value.empty() ? "none" : setting.default_value);
    if (!setting.doc.empty())
      out += wrap_text(setting.doc, kIndent, width.value_or(std::numeric_limits<std::size_t>::max()));
  }
  return out;
}

}  // namespace candela::client
