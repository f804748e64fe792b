#include "common/stats/error_context.h"

#include <charconv>

namespace candela::stats {

ErrorContext context_of(const SettingsMap& settings, std::string_view plan) {
  constexpr double kAdaptive = 2.0 / 3;
  constexpr double kOfPhotons = 4, kOfBalancedRadii = 3, kOfKeptRadii = 9;
  constexpr double kWithConnections = 1.0 / 3, kConnectionsOfKeptRadii = 1;
  if (!settings.contains("radius")) return {};  // what merges has one
  const auto has = [&](std::string_view words) { return plan.find(words) != std::string_view::npos; };
  const bool all = has("use  everything");
  if (has("skip merging") && !has("use  merging") && !has("use  photon") && !all) return {};
  double alpha = kAdaptive;
  if (const auto found = settings.find("alpha"); found != settings.end()) {
    const std::string& text = found->second;
    std::from_chars(text.data(), text.data() + text.size(), alpha);
  }
  ErrorContext context;
  context.connects = has("use  connections");
  context.alpha = context.connects ? alpha : (1 + alpha) / 2;
  const bool kept = settings.contains("alpha_f") || settings.contains("alpha_chi");
  context.expected_bias = kOfPhotons;
  if (context.connects)
    context.expected_bias = kept ? kConnectionsOfKeptRadii : kWithConnections;
  else if (settings.contains("r_max"))
    context.expected_bias = kOfBalancedRadii;
  else if (kept)
    context.expected_bias = kOfKeptRadii;
  return context;
}

}  // namespace candela::stats
