#include "common/adaptive/f_test.h"

#include <algorithm>

namespace candela::adaptive {
namespace {

constexpr int kSumBits = 42;

Uint128 magnitude(Int128 value) {
  return value < 0 ? -static_cast<Uint128>(value) : static_cast<Uint128>(value);
}

// The power of 2 that sums are divided by.
int reduction(std::span<const Int128> sums) {
  Uint128 largest = 0;
  for (const Int128 sum : sums) largest = std::max(largest, magnitude(sum));
  int down = 0;
  while (largest >> down > Uint128{1} << kSumBits) ++down;
  return down;
}

Uint128 reduced_squares(const SectorSums& sums, int down) {
  return (static_cast<Uint128>(sums.squares) << sums.square_shift) >> (2 * down);
}

}  // namespace

bool f_exceeds(const SectorSums& sums, std::uint64_t critical) {
  if (sums.squares <= 0) return false;
  const int down = reduction(sums.sums);

  const auto n = static_cast<Int128>(sums.sums.size());
  Int128 of_squares = 0, total = 0;
  for (Int128 sum : sums.sums) {
    sum >>= down;
    of_squares += sum * sum;
    total += sum;
  }
  // |sum| <= 2^42 and n <= 12: below 2^92, and 2^32 times that below 2^124.
  const auto left = static_cast<Uint128>(n * of_squares - total * total) << 32;
  const Uint128 squares = reduced_squares(sums, down);
  Uint128 right = 0;
  // A product beyond 128 bits is larger than the left side.
  if (__builtin_mul_overflow(squares, static_cast<Uint128>(critical) * static_cast<Uint128>(n - 1), &right))
    return false;
  return left > right;
}

bool few_contributions(const SectorSums& sums, std::uint64_t number) {
  if (sums.squares <= 0) return true;
  const int down = reduction(sums.sums);
  Int128 total = 0;
  for (const Int128 sum : sums.sums) total += sum >> down;
  const Uint128 size = magnitude(total);
  Uint128 right = 0;
  if (__builtin_mul_overflow(reduced_squares(sums, down), static_cast<Uint128>(number), &right)) return true;
  return size * size <= right;
}

}  // namespace candela::adaptive
