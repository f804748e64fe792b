// The rule of FPPM with rings and nested discs: sums are never zeroed, those of all epochs count at every
// level, and a pixel may fall by several levels at once. The memo has planes of looks and rejections, and for
// nested discs the number of iterations whose radius reached each ring, 5 bytes each.
#include <array>

#include "common/adaptive/rings.h"
#include "common/stages/rules/level_state.h"
#include "common/stages/rules/radius_rules.h"

namespace candela::rules {
namespace {

using adaptive::kRings;

constexpr std::size_t kPlanes = 2;
constexpr std::size_t kPassBytes = 5;  // below 2^40 iterations

// Adds to a little-endian integer.
std::uint64_t add_passes(char* bytes, std::uint64_t more) {
  std::uint64_t value = more;
  for (std::size_t i = 0; i < kPassBytes; ++i)
    value += std::uint64_t{static_cast<unsigned char>(bytes[i])} << (8 * i);
  for (std::size_t i = 0; i < kPassBytes; ++i) bytes[i] = static_cast<char>((value >> (8 * i)) & 0xff);
  return value;
}

}  // namespace

std::uint64_t fppm_rings_memo_bytes(bool nested) {
  return kPlanes + (nested ? kRings * kPassBytes : 0);
}

Result<std::string> decide_fppm_rings(const DecisionInput& input, Carry& carry, bool nested, bool rings) {
  const std::vector<std::string> names = {rings ? adaptive::kRingSectors : adaptive::kDiscs,
                                          adaptive::kRingSquares};
  CANDELA_TRY(check_input(input, carry, names, fppm_rings_memo_bytes(nested)));
  const SettingsMap& constants = input.plan.constants;
  CANDELA_ASSIGN(const adaptive::Levels levels, adaptive::get_levels(constants));
  CANDELA_ASSIGN(const std::uint64_t critical,
                 rings ? adaptive::get_integer(constants, "critical") : Result<std::uint64_t>(0));
  CANDELA_ASSIGN(const double kappa, nested ? adaptive::get_number(constants, "kappa") : Result<double>(0));
  if (input.epoch == 0) return std::string(pixels_of(input), '\0');
  std::string state(input.previous);
  if (!input.folded) return state;

  for (std::size_t i = 0; i < carry.sums.size(); ++i)
    CANDELA_TRY(carry.sums[i].merge(*input.folded->sums[i]));
  const film::AccumulatorSpec& sums_spec = carry.sums[0].spec();
  const int square_shift = 2 * sums_spec.scale_log2 - carry.sums[1].spec().scale_log2;
  const std::size_t per_ring = rings ? adaptive::kSectorsPerRing : 1;
  if (sums_spec.channels != kRings * per_ring || carry.sums[1].spec().channels != kRings ||
      square_shift < 0 || square_shift > 20)
    return failed_error("the accumulators of the rings have another form");
  const double unit_of_squares = static_cast<double>(1 << square_shift);
  const std::uint64_t passes =
      first_iteration(input.plan, input.folded->epoch + 1) - first_iteration(input.plan, input.folded->epoch);
  const int deepest = std::min(levels.deepest(first_iteration(input.plan, input.epoch)), kRings - 2);
  const std::size_t pixels = pixels_of(input);
  std::vector<Int128> sums(sums_spec.channels);
  std::array<Int128, kRings> squares{};
  std::size_t pixel = 0;
  for (std::uint32_t y = 0; y < input.height; ++y)
    for (std::uint32_t x = 0; x < input.width; ++x, ++pixel) {
      adaptive::DiscSums disc;
      if (nested) {
        char* const reached = carry.memo.data() + kPlanes * pixels + pixel * kRings * kPassBytes;
        const int rendered = level_at(input.folded->state, pixel);
        for (int g = 0; g < kRings; ++g)
          disc.passes[static_cast<std::size_t>(g)] = static_cast<double>(
              add_passes(reached + static_cast<std::size_t>(g) * kPassBytes, g >= rendered ? passes : 0));
      }
      carry.sums[1].get_pixel(x, y, squares);
      if (std::all_of(squares.begin(), squares.end(), [](Int128 s) { return s == 0; })) continue;
      carry.sums[0].get_pixel(x, y, sums);
      const int before = level_at(state, pixel);
      int level = before;
      count_up(carry.memo[pixel]);
      if (rings) level = adaptive::ring_level(sums, squares, square_shift, critical, nested, level, deepest);
      if (nested) {
        for (std::size_t g = 0; g < kRings; ++g) {
          for (std::size_t s = 0; s < per_ring; ++s)
            disc.sums[g] += static_cast<double>(sums[g * per_ring + s]);
          disc.squares[g] = static_cast<double>(squares[g]) * unit_of_squares;
        }
        const int largest = std::min(adaptive::nested_level(disc, kappa), deepest);
        // Beside the F test, which knows no way back, the radius never grows.
        level = rings ? std::max(level, largest) : largest;
      }
      if (level > before) count_up(carry.memo[pixels + pixel]);
      state[pixel] = static_cast<char>(level);
    }
  return state;
}

}  // namespace candela::rules
