#include "common/stages/rules/light_visibility.h"

#include <fmt/format.h>

#include <charconv>
#include <cstdint>

#include "common/stages/light_visibility.h"

namespace candela::rules {
namespace {

// 0: there is none.
std::uint64_t constant(const DecisionInput& input, std::string_view name) {
  const auto found = input.plan.constants.find(std::string(name));
  if (found == input.plan.constants.end()) return 0;
  const std::string& text = found->second;
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() ? value : 0;
}
// 0: there is none that fits.
std::uint64_t entries_of(const DecisionInput& input, const film::AccumulatorSpec& spec) {
  const std::uint64_t entries = constant(input, light_visibility::kEntries);
  const bool has = spec.name == light_visibility::kCounts && spec.channels == 2 && spec.entries == entries;
  return has ? entries : 0;
}

}  // namespace

Result<std::string> decide_light_visibility(const DecisionInput& input, Carry& carry) {
  const std::uint64_t entries = carry.sums.size() == 1 ? entries_of(input, carry.sums[0].spec()) : 0,
                      lights = constant(input, light_visibility::kLights);
  if (entries == 0 || lights == 0 || entries % lights != 0)
    return failed_error(
        fmt::format("the rule '{}' needs accumulators that are not the job's", input.plan.rule));
  if (input.folded) {
    if (input.folded->sums.size() != 1) return failed_error("the epoch to fold is of another job");
    CANDELA_TRY(carry.sums[0].merge(*input.folded->sums[0]));
  }
  if (input.folded && input.folded->epoch > 0 && input.previous.empty()) return std::string();
  const film::MergedAccumulator& counts = carry.sums[0];
  light_visibility::ExpectedGain gain;
  std::string state(entries, '\0');
  for (std::uint32_t entry = 0; entry < entries; ++entry) {
    const auto at = film::place_of_entry(entry);
    const auto tested = static_cast<std::uint64_t>(counts.sum(at.x, at.y, 0)),
               seen = static_cast<std::uint64_t>(counts.sum(at.x, at.y, 1));
    state[entry] = static_cast<char>(light_visibility::weight(tested, seen));
    gain.add(tested, seen);
    if ((entry + 1) % lights == 0) gain.end_cell();
  }
  if (input.folded && input.folded->epoch == 0 && gain.too_small()) state.clear();
  return state;
}

}  // namespace candela::rules
