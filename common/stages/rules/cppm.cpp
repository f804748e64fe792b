// The rule of CPPM: a chi-squared test on counts of photons whenever a batch is full. The memo has three
// planes: number of the batch, looks, rejections.
#include <array>

#include "common/adaptive/chi_squared_counts.h"
#include "common/stages/rules/level_state.h"
#include "common/stages/rules/radius_rules.h"

namespace candela::rules {
namespace {

// Levels of the nested branch, whose area is half: a level has the area 2^(-1/3) = 0.794, near the authors'
// 0.8.
constexpr std::uint64_t kHalvingLevels = 3;

const std::vector<std::string>& cppm_accumulators() {
  static const std::vector<std::string> names = {adaptive::kCounts};
  return names;
}

constexpr std::uint64_t kMemoPlanes = 3;

}  // namespace

std::uint64_t cppm_memo_bytes(const EpochPlan& /*plan*/) {
  return kMemoPlanes;
}

Result<std::string> decide_cppm(const DecisionInput& input, Carry& carry) {
  CANDELA_TRY(check_input(input, carry, cppm_accumulators(), kMemoPlanes));
  const SettingsMap& constants = input.plan.constants;
  CANDELA_ASSIGN(const adaptive::Levels levels, adaptive::get_levels(constants));
  adaptive::CountsTest test;
  CANDELA_ASSIGN(test.critical_outer, adaptive::get_integer(constants, "critical_outer"));
  CANDELA_ASSIGN(test.critical_inner, adaptive::get_integer(constants, "critical_inner"));
  CANDELA_ASSIGN(test.first_batch, adaptive::get_integer(constants, "first_batch"));
  CANDELA_ASSIGN(test.batch_growth, adaptive::get_integer(constants, "batch_growth"));
  if (input.epoch == 0) return std::string(pixels_of(input), '\0');
  std::string state(input.previous);
  if (!input.folded) return state;

  film::MergedAccumulator& counts = carry.sums[0];
  if (counts.spec().channels != adaptive::kSectorChannels)
    return failed_error("the accumulator of the chi-squared test has another form");
  const std::vector<adaptive::Uint128> batches = adaptive::batch_sizes(test);
  const int deepest = levels.deepest(first_iteration(input.plan, input.epoch));
  const std::size_t pixels = pixels_of(input);
  char* const batch_of = carry.memo.data();
  char* const looks = batch_of + pixels;
  char* const rejections = looks + pixels;
  std::array<Int128, adaptive::kSectorChannels> sums{}, added{};
  std::size_t pixel = 0;
  for (std::uint32_t y = 0; y < input.height; ++y)
    for (std::uint32_t x = 0; x < input.width; ++x, ++pixel) {
      if (input.folded->state[pixel] != state[pixel]) continue;
      input.folded->sums[0]->get_pixel(x, y, added);
      const bool none = std::all_of(added.begin(), added.end(), [](Int128 c) { return c == 0; });
      if (none) continue;
      counts.get_pixel(x, y, sums);
      for (std::size_t s = 0; s < sums.size(); ++s) sums[s] += added[s];
      const int level = level_at(state, pixel);
      if (level < deepest) {
        const auto batch = static_cast<unsigned char>(batch_of[pixel]);
        const adaptive::CountsVerdict verdict = adaptive::test_counts(test, sums, batches[batch]);
        if (verdict != adaptive::CountsVerdict::waits) count_up(looks[pixel]);
        if (verdict == adaptive::CountsVerdict::shrinks || verdict == adaptive::CountsVerdict::halves) {
          // The batch grows by as many steps as the radius falls by levels: r^2 then falls as N^-(1-alpha)
          // with one alpha in both branches.
          const std::uint64_t steps = verdict == adaptive::CountsVerdict::shrinks ? 1 : kHalvingLevels;
          state[pixel] = static_cast<char>(
              std::min(static_cast<std::uint64_t>(level) + steps, static_cast<std::uint64_t>(deepest)));
          for (std::uint64_t i = 0; i < steps; ++i) count_up(batch_of[pixel]);
          count_up(rejections[pixel]);
          sums.fill(0);
        }
      }
      counts.set_pixel(x, y, sums);
    }
  return state;
}

Result<StateReport> describe_cppm(const EpochPlan& plan, std::uint64_t /*epoch*/, std::uint32_t /*width*/,
                                  std::uint32_t /*height*/, std::string_view state, const Carry& carry,
                                  bool with_layers) {
  const std::string_view memo = carry.memo;
  if (memo.size() != 3 * state.size()) return failed_error("the state is of another film than its memo");
  return describe_levels(plan, state,
                         {{"looks", "tests.looks", memo.substr(state.size(), state.size())},
                          {"rejections", "tests.rejections", memo.substr(2 * state.size(), state.size())}},
                         with_layers);
}

}  // namespace candela::rules
