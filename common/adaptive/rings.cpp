#include "common/adaptive/rings.h"

#include <algorithm>
#include <cmath>

namespace candela::adaptive {

std::array<Int128, kSectorChannels> sectors_at(std::span<const Int128> rings, int level) {
  std::array<Int128, kSectorChannels> sectors{};
  const auto g = static_cast<std::size_t>(level);
  for (std::size_t s = 0; s < kSectorsPerRing; ++s) {
    sectors[kSectorsPerRing + s] = rings[g * kSectorsPerRing + s];
    for (std::size_t ring = g + 1; ring < kRings; ++ring) sectors[s] += rings[ring * kSectorsPerRing + s];
  }
  return sectors;
}

int ring_level(std::span<const Int128> rings, std::span<const Int128, kRings> squares, int square_shift,
               std::uint64_t critical, bool pairs, int level, int deepest) {
  deepest = std::min(deepest, kRings - 2);
  for (; level < deepest; ++level) {
    Int128 square = 0;
    for (std::size_t ring = static_cast<std::size_t>(level); ring < kRings; ++ring) square += squares[ring];
    const auto sectors = sectors_at(rings, level);
    const auto of_pairs = antipodal(sectors);
    const std::span<const Int128> sums =
        pairs ? std::span<const Int128>(of_pairs) : std::span<const Int128>(sectors);
    if (!f_exceeds({sums, square, square_shift}, critical)) break;
  }
  return level;
}

int nested_level(const DiscSums& disc, double kappa) {
  constexpr std::size_t kDepth = 6;
  constexpr double kMinPhotons = 8;
  // The disc of level g is all rings from g on. This has its area, the integral of the field over it with
  // every ring's mean over its own iterations, the variance of that integral for a second moment of 1 per
  // area and iteration, and plain sums. Areas are shares of the first disc.
  struct Disc {
    double area = 0, integral = 0, variance = 0, sum = 0, squares = 0, covered = 0;
  };
  std::array<Disc, kRings + 1> discs{};
  for (std::size_t g = kRings; g-- > 0;) {
    const double area =
        g == kRings - 1 ? std::ldexp(1.0, -static_cast<int>(g)) : std::ldexp(1.0, -static_cast<int>(g) - 1);
    const double passes = std::max(disc.passes[g], 1.0);
    discs[g] = discs[g + 1];
    discs[g].area += area;
    discs[g].integral += disc.sums[g] / passes;
    discs[g].variance += area / passes;
    discs[g].sum += disc.sums[g];
    discs[g].squares += disc.squares[g];
    discs[g].covered += passes * area;
  }
  const auto agrees = [&](std::size_t g) {
    if (!(disc.passes[g] > 0)) return false;
    const double moment = discs[g].squares / discs[g].covered;
    for (std::size_t h = g + 1; h < std::min<std::size_t>(g + 1 + kDepth, kRings); ++h) {
      if (discs[h].sum * discs[h].sum < kMinPhotons * discs[h].squares || !(discs[h].squares > 0)) continue;
      const double inner = 1 / discs[h].area, outer = 1 / discs[g].area;
      const double variance = moment * ((discs[g].variance - discs[h].variance) * outer * outer +
                                        discs[h].variance * (outer - inner) * (outer - inner));
      const double difference = discs[g].integral * outer - discs[h].integral * inner;
      if (difference * difference > kappa * kappa * variance) return false;
    }
    return true;
  };
  for (std::size_t g = 0; g < kRings - 2; ++g)
    if (agrees(g)) return static_cast<int>(g);
  return kRings - 2;
}

}  // namespace candela::adaptive
