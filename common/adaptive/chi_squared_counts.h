// The chi-squared test of CPPM: numbers of photons in sectors of equal area [Lin et al. 2020; Lin et al.
// 2023, section 4]. Counts know nothing of contributions: the test is the baseline that FPPM is compared
// with.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/adaptive/f_test.h"

namespace candela::adaptive {

// n sum c^2 / C - C > critical * 2^-32, C = sum c. False if there are no photons. Preconditions: 2 <= n <=
// 12, 0 <= counts <= 2^103, critical < 2^42.
bool counts_exceed(std::span<const Int128> counts, std::uint64_t critical);

struct CountsTest {
  std::uint64_t critical_outer = 0;  // of 12 sectors, times 2^32
  std::uint64_t critical_inner = 0;  // of the inner 6
  std::uint64_t first_batch = 0;     // photons before the first test
  std::uint64_t batch_growth = 0;    // of the batch at each step, times 2^16
};

// Photons that the tests number 0, 1, ... 255 wait for: ceil(first_batch growth^number), in steps rounded
// down at 2^-16 photons; at most 2^100.
std::vector<Uint128> batch_sizes(const CountsTest& test);

// Keeps the radius; or shrinks by one level, if the inner sectors fail the test as well; or goes to the inner
// disc, which is the largest that passes.
enum class CountsVerdict { waits, keeps, shrinks, halves };
// Precondition: 12 counts, none negative.
CountsVerdict test_counts(const CountsTest& test, std::span<const Int128> counts, Uint128 batch);

}  // namespace candela::adaptive
