// The F test of equal sector means in its limit of many samples, on integer sums.
//
//   F = n/(n-1) (sum_s S_s^2 - (sum_s S_s)^2 / n) / Q
//
// S_s: sum of phi in sector s of n; Q: sum of phi^2. This is the statistic of Lin et al. 2023, Eq. 7, for
// m -> infinity samples a sector: m differs from infinity by the number of hits per sector and light path,
// which is 1e-4 and less. The number of light paths drops out. Under the null hypothesis E F = 1, and
// (n - 1) F tends to chi-squared with n - 1 degrees of freedom.
#pragma once

#include <cstdint>
#include <span>

#include "common/adaptive/channels.h"
#include "common/film/tile_sums.h"

namespace candela::adaptive {

using film::Int128;
using film::Uint128;

// The sums of one pixel. Real sums of phi are sums * 2^-scale; real sums of squares are
// squares * 2^(square_shift - 2 scale).
struct SectorSums {
  std::span<const Int128> sums;
  Int128 squares = 0;
  int square_shift = kSquareShift;
};

// F > critical * 2^-32, in 128-bit integers: (n sum S^2 - (sum S)^2) 2^32 > critical (n - 1) Q. False if Q is
// not above 0, for then there is no evidence. If a sum exceeds 2^42, all are first divided by the same power
// of 2 and rounded down, Q by its square. Preconditions: 2 <= n <= 12, |sums| and |squares| <= 2^103,
// 0 <= square_shift <= 20, critical < 2^60.
bool f_exceeds(const SectorSums& sums, std::uint64_t critical);

// (sum_s S_s)^2 <= number Q: the sums come from as few contributions, counted as equal ones. True if Q is not
// above 0. Reduces sums as f_exceeds() does. Preconditions: of f_exceeds(); number < 2^32.
bool few_contributions(const SectorSums& sums, std::uint64_t number);

}  // namespace candela::adaptive
