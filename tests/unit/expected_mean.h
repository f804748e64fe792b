// The mean of samples against the value that it estimates.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "tests/statistical/moments.h"

namespace candela::test {

// Two-sided tests are at so many standard errors: a false alarm has probability 6e-7.
inline constexpr double kMaxErrors = 5;

// `most`: what one sample adds at most. A mean of fewer than 40 such samples says nothing by its own error.
inline void expect_mean(const statistical::Moments& mean, double expected, const std::string& what,
                        double slack, double most) {
  if (expected > 0 && expected * static_cast<double>(mean.count()) < 40 * most) return;
  EXPECT_LE(std::abs(mean.mean() - expected), kMaxErrors * mean.error() + slack * std::abs(expected) + 1e-12)
      << what << ": " << mean.mean() << " +- " << mean.error() << ", expected " << expected;
}

}  // namespace candela::test
