#include "common/adaptive/chi_squared_counts.h"

#include <algorithm>

namespace candela::adaptive {
namespace {

constexpr int kCountBits = 42;
constexpr int kGrowthBits = 16;
constexpr int kBatches = 256;
constexpr Uint128 kMaxBatch = Uint128{1} << 100;

Uint128 total_of(std::span<const Int128> counts) {
  Uint128 total = 0;
  for (const Int128 count : counts) total += static_cast<Uint128>(count);
  return total;
}

}  // namespace

bool counts_exceed(std::span<const Int128> counts, std::uint64_t critical) {
  Uint128 largest = 0;
  for (const Int128 count : counts) largest = std::max(largest, static_cast<Uint128>(count));
  int down = 0;
  while (largest >> down > Uint128{1} << kCountBits) ++down;
  Int128 squares = 0, total = 0;
  for (Int128 count : counts) {
    count >>= down;
    squares += count * count;
    total += count;
  }
  // The statistic grows as the counts do: dividing them by 2^down divides it by 2^down.
  const auto n = static_cast<Int128>(counts.size());
  const auto left = static_cast<Uint128>(n * squares - total * total) << 32;  // below 2^124
  const Uint128 right = (static_cast<Uint128>(critical) * static_cast<Uint128>(total)) >> down;
  return left > right;
}

std::vector<Uint128> batch_sizes(const CountsTest& test) {
  std::vector<Uint128> sizes;
  Uint128 size = static_cast<Uint128>(test.first_batch) << kGrowthBits;
  for (int i = 0; i < kBatches; ++i) {
    sizes.push_back(std::min((size + ((1U << kGrowthBits) - 1)) >> kGrowthBits, kMaxBatch));
    Uint128 next = 0;
    const bool overflows = __builtin_mul_overflow(size, static_cast<Uint128>(test.batch_growth), &next);
    size = overflows ? kMaxBatch << kGrowthBits : next >> kGrowthBits;
  }
  return sizes;
}

CountsVerdict test_counts(const CountsTest& test, std::span<const Int128> counts, Uint128 batch) {
  const Uint128 total = total_of(counts);
  if (total == 0 || total < batch) return CountsVerdict::waits;
  if (!counts_exceed(counts, test.critical_outer)) return CountsVerdict::keeps;
  return counts_exceed(counts.first(kSectorsPerRing), test.critical_inner) ? CountsVerdict::shrinks
                                                                           : CountsVerdict::halves;
}

}  // namespace candela::adaptive
