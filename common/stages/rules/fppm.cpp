// The rule of FPPM and VCM+: r <- k r where the F test rejects equal sectors [Lin et al. 2023, Eq. 21], of
// luminance or of one of three colors.
//
// Sums count for a pixel only if they were made with its present radius: sums of the epochs that were open
// when it shrank are dropped. After a rejection the pixel begins anew.
//
// With `follow` a pixel without evidence takes the levels of a schedule, one a look; with `follow_little` a
// pixel of little evidence takes the levels of a second schedule.
#include <algorithm>
#include <span>
#include <vector>

#include "common/adaptive/f_test.h"
#include "common/stages/rules/level_state.h"
#include "common/stages/rules/radius_rules.h"

namespace candela::rules {
namespace {

const std::vector<std::string>& fppm_accumulators() {
  static const std::vector<std::string> names = {adaptive::kSectors, adaptive::kSquares};
  return names;
}

// Looks, and with `follow`, where a level may be no rejection, rejections.
std::size_t memo_planes(const SettingsMap& constants) {
  return constants.contains("follow") ? 2 : 1;
}

// Levels of pixels whose test has at most this evidence.
struct Follow {
  std::uint64_t evidence = 0;
  int level = 0;  // that such a pixel has at least
  // Sums of each color.
  bool moves(int from, std::span<const adaptive::SectorSums> colors) const {
    return from < level && std::all_of(colors.begin(), colors.end(), [&](const adaptive::SectorSums& sums) {
             return adaptive::few_contributions(sums, evidence);
           });
  }
};
Result<Follow> follow_at(const SettingsMap& constants, const std::string& suffix, std::uint64_t iteration,
                         int deepest) {
  Follow follow;
  CANDELA_ASSIGN(const std::vector<std::uint64_t> iterations,
                 adaptive::get_iterations(constants, "follow" + suffix));
  if (iterations.empty()) return follow;
  CANDELA_ASSIGN(follow.evidence, adaptive::get_integer(constants, "evidence" + suffix));
  follow.level = static_cast<int>(std::upper_bound(iterations.begin(), iterations.end(), iteration) -
                                  iterations.begin());
  follow.level = std::min(follow.level, deepest);
  return follow;
}

}  // namespace

std::uint64_t fppm_memo_bytes(const EpochPlan& plan) {
  return memo_planes(plan.constants);
}

Result<std::string> decide_fppm(const DecisionInput& input, Carry& carry) {
  const SettingsMap& constants = input.plan.constants;
  CANDELA_TRY(check_input(input, carry, fppm_accumulators(), memo_planes(constants)));
  CANDELA_ASSIGN(const adaptive::Levels levels, adaptive::get_levels(constants));
  CANDELA_ASSIGN(const std::uint64_t critical, adaptive::get_integer(constants, "critical"));
  if (input.epoch == 0) return std::string(pixels_of(input), '\0');
  std::string state(input.previous);
  if (!input.folded) return state;

  film::MergedAccumulator& sectors = carry.sums[0];
  film::MergedAccumulator& squares = carry.sums[1];
  const int square_shift = 2 * sectors.spec().scale_log2 - squares.spec().scale_log2;
  const std::size_t colors = squares.spec().channels;
  if ((colors != 1 && colors != adaptive::kColors) ||
      sectors.spec().channels != colors * adaptive::kSectorChannels || square_shift < 0 || square_shift > 20)
    return failed_error("the accumulators of the F test have another form");
  const std::uint64_t first = first_iteration(input.plan, input.epoch);
  const int deepest = levels.deepest(first);
  CANDELA_ASSIGN(const Follow none_at, follow_at(constants, "", first, deepest));
  CANDELA_ASSIGN(const Follow little_at, follow_at(constants, "_little", first, deepest));
  const bool counts_rejections = memo_planes(constants) > 1;
  std::vector<Int128> sums(colors * adaptive::kSectorChannels), added(sums.size());
  std::vector<Int128> square(colors), added_square(colors);
  std::vector<adaptive::SectorSums> of_colors(colors);
  const auto is_zero = [](const std::vector<Int128>& values) {
    return std::all_of(values.begin(), values.end(), [](Int128 value) { return value == 0; });
  };
  const auto rejects = [&](const adaptive::SectorSums& one) { return adaptive::f_exceeds(one, critical); };
  std::size_t pixel = 0;
  for (std::uint32_t y = 0; y < input.height; ++y)
    for (std::uint32_t x = 0; x < input.width; ++x, ++pixel) {
      if (input.folded->state[pixel] != state[pixel]) continue;
      input.folded->sums[0]->get_pixel(x, y, added);
      input.folded->sums[1]->get_pixel(x, y, added_square);
      const int level = level_at(state, pixel);
      const bool behind = level < std::max(none_at.level, little_at.level);
      if (is_zero(added) && is_zero(added_square) && !behind) continue;  // no photons: nothing new to test
      sectors.get_pixel(x, y, sums);
      squares.get_pixel(x, y, square);
      for (std::size_t s = 0; s < sums.size(); ++s) sums[s] += added[s];
      for (std::size_t c = 0; c < colors; ++c) {
        square[c] += added_square[c];
        of_colors[c] = {
            std::span<const Int128>(sums).subspan(c * adaptive::kSectorChannels, adaptive::kSectorChannels),
            square[c], square_shift};
      }
      // A pixel at its floor collects sums for the time when the floor falls.
      if (level < deepest) {
        count_up(carry.memo[pixel]);
        const bool rejected = std::any_of(of_colors.begin(), of_colors.end(), rejects);
        if (rejected && counts_rejections) count_up(carry.memo[state.size() + pixel]);
        if (rejected || none_at.moves(level, of_colors) || little_at.moves(level, of_colors)) {
          ++state[pixel];
          std::fill(sums.begin(), sums.end(), 0);
          std::fill(square.begin(), square.end(), 0);
        }
      }
      sectors.set_pixel(x, y, sums);
      squares.set_pixel(x, y, square);
    }
  return state;
}

Result<StateReport> describe_fppm(const EpochPlan& plan, std::uint64_t /*epoch*/, std::uint32_t /*width*/,
                                  std::uint32_t /*height*/, std::string_view state, const Carry& carry,
                                  bool with_layers) {
  const std::string_view memo = carry.memo;
  if (memo.size() < state.size()) return failed_error("the state is of another film than its memo");
  // Without `follow` every rejection is one level, and the memo has no plane of them.
  const std::string_view rejections =
      memo.size() > state.size() ? memo.substr(state.size(), state.size()) : state;
  return describe_levels(plan, state,
                         {{"looks", "tests.looks", memo.substr(0, state.size())},
                          {"rejections", "tests.rejections", rejections}},
                         with_layers);
}

}  // namespace candela::rules
