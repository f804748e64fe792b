// The table of primary samples: what a rejection undoes, what bytes hold, and how many, and how far numbers
// have moved that were not asked for.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "common/chains/chains.h"
#include "tests/unit/kolmogorov.h"
#include "worker/mcmc/primary_state.h"

namespace candela::mcmc {
namespace {

// Asks for some numbers of all walks, which ones being decided by `pattern`.
std::vector<float> ask(PrimaryState& state, std::uint64_t pattern, std::uint32_t most) {
  std::vector<float> numbers;
  rng::Stream stream(pattern);
  for (const auto walk : {PrimaryState::eye, PrimaryState::light, PrimaryState::choice}) {
    const std::uint32_t limit = walk == PrimaryState::choice ? 4 : most;
    for (std::uint32_t dimension = 0; dimension < limit; ++dimension) {
      if (stream.next_float() < 0.5f) continue;
      if (dimension % 3 == 0) {
        numbers.push_back(state.walk(walk).draw_1d(dimension, true));
      } else {
        const Vec2 p = state.walk(walk).draw_2d(dimension, true);
        numbers.insert(numbers.end(), {p.x, p.y});
      }
    }
  }
  return numbers;
}

// Claim: a rejected proposal leaves every number as it was, of those the state had asked for and of others;
// an accepted one becomes the state; and a proposal asked twice gives the same numbers.
TEST(McmcState, RejectionRestores) {
  PrimaryState state({});
  state.start(3);
  std::uint64_t present = 1;  // pattern of the present state
  rng::Stream stream(9);
  for (std::uint64_t m = 0; m < 500; ++m) {
    const std::vector<float> before = ask(state, present, 30);
    const bool large = stream.next_float() < 0.1f;
    const std::uint64_t pattern = stream.next_u64();
    state.propose(rng::key(4, m), large);
    const std::vector<float> proposed = ask(state, pattern, 30);
    EXPECT_EQ(ask(state, pattern, 30), proposed);
    if (stream.next_float() < 0.5f) {
      state.accept();
      present = pattern;
      ASSERT_EQ(ask(state, present, 30), proposed) << m;
    } else {
      state.reject();
      ASSERT_EQ(ask(state, present, 30), before) << m;
    }
  }
}

// Claim: a state restored from its bytes, at any mutation, gives the same numbers then and ever after, and
// the same bytes.
TEST(McmcState, BytesHoldTheState) {
  PrimaryState whole({});
  whole.start(3);
  rng::Stream stream(10);
  auto restored = std::make_unique<PrimaryState>(StepSizes{});
  for (std::uint64_t m = 0; m < 400; ++m) {
    if (m % 7 == 0) {
      const std::string bytes = whole.save();
      restored = std::make_unique<PrimaryState>(StepSizes{});
      ASSERT_TRUE(restored->restore(bytes).ok());
      ASSERT_EQ(restored->save(), bytes);
    }
    const bool large = stream.next_float() < 0.05f;
    const bool accept = stream.next_float() < 0.6f;
    const std::uint64_t pattern = stream.next_u64();
    for (PrimaryState* state : {&whole, restored.get()}) state->propose(rng::key(4, m), large);
    ASSERT_EQ(ask(whole, pattern, 40), ask(*restored, pattern, 40)) << m;
    for (PrimaryState* state : {&whole, restored.get()}) accept ? state->accept() : state->reject();
  }
}

// Claim: a state of paths of any length stays within what the farm takes; numbers beyond what is stored stay
// where they are under small steps and change with large ones.
TEST(McmcState, BytesAreBounded) {
  constexpr std::uint32_t kMany = 3 * PrimarySampler::kMaxDimensions;
  PrimaryState state({});
  state.start(3);
  const auto beyond = [&] {
    return state.walk(PrimaryState::light).draw_1d(PrimarySampler::kMaxDimensions + 5, true);
  };
  const float at_first = beyond();
  for (std::uint64_t m = 0; m < 3; ++m) {
    state.propose(rng::key(4, m), false);
    for (std::uint32_t i = 0; i < kMany; ++i)
      for (const auto walk : {PrimaryState::eye, PrimaryState::light}) state.walk(walk).draw_2d(i, true);
    for (std::uint32_t i = 0; i < 64; ++i) state.walk(PrimaryState::choice).draw_2d(i, true);
    EXPECT_EQ(beyond(), at_first);
    state.accept();
  }
  const std::string bytes = state.save();
  EXPECT_LE(bytes.size(), chains::kMaxStateBytes);
  EXPECT_GT(bytes.size(), chains::kMaxStateBytes / 2);
  PrimaryState restored({});
  ASSERT_TRUE(restored.restore(bytes).ok());
  EXPECT_EQ(restored.walk(PrimaryState::light).draw_1d(PrimarySampler::kMaxDimensions + 5, true), at_first);
  state.propose(5, true);
  EXPECT_NE(beyond(), at_first);
}

// Claim: bytes cut short or grown, or with a number from the future, are input errors.
TEST(McmcState, BadBytesAreRefused) {
  PrimaryState state({});
  state.start(3);
  state.propose(4, false);
  ask(state, 1, 10);
  state.accept();
  const std::string bytes = state.save();
  PrimaryState other({});
  ASSERT_TRUE(other.restore(bytes).ok());
  for (std::size_t length = 0; length < bytes.size(); ++length) {
    const auto result = other.restore(std::string_view(bytes).substr(0, length));
    ASSERT_FALSE(result.ok()) << length;
    EXPECT_EQ(result.error().kind, ErrorKind::input);
  }
  EXPECT_FALSE(other.restore(bytes + '\0').ok());
  std::string wrong = bytes;
  wrong[0] ^= 1;
  EXPECT_FALSE(other.restore(wrong).ok()) << "magic";
  wrong = bytes;
  wrong[12] = 0;  // no small step was taken: the numbers' times lie in the future
  EXPECT_FALSE(other.restore(wrong).ok());
}

// Distances that numbers moved, as fractions of the circle in [-1/2, 1/2): one of a draw of one, two of a
// draw of two.
struct Moved {
  std::array<std::vector<double>, 3> by;
};

// Moves of `states` states that accept `steps` small steps, with rejected proposals of both kinds in between
// and at the end. Two draws are asked for at the start, and then by the last step alone, or (`always`) by all
// of them.
Moved moved_by(std::uint64_t steps, bool always, std::uint64_t states, StepSizes sizes, std::uint64_t seed) {
  Moved moved;
  for (std::uint64_t i = 0; i < states; ++i) {
    PrimaryState state(sizes);
    state.start(rng::key(seed, i, 0));
    PrimarySampler& eye = state.walk(PrimaryState::eye);
    const auto ask_both = [&] {
      const float one = eye.draw_1d(3, true);
      const Vec2 two = eye.draw_2d(5, true);
      return std::array{one, two.x, two.y};
    };
    rng::Stream stream(rng::key(seed, i, 1));
    const auto reject_some = [&](bool asked) {
      while (stream.next_float() < 0.4f) {
        state.propose(stream.next_u64(), stream.next_float() < 0.3f);
        if (asked) ask_both();
        state.reject();
      }
    };
    const auto first = ask_both();
    for (std::uint64_t step = 1; step <= steps; ++step) {
      const bool last = step == steps;
      // Numbers that a rejected proposal asked for have made up for what it missed: in the end, none does.
      reject_some(always || i % 2 == 0);
      state.propose(stream.next_u64(), false);
      if (always || last) ask_both();
      state.accept();
    }
    reject_some(true);
    const auto now = ask_both();
    for (std::size_t k = 0; k < now.size(); ++k) {
      const double d = static_cast<double>(now[k]) - static_cast<double>(first[k]);
      moved.by[k].push_back(d - std::floor(d + 0.5));
    }
  }
  return moved;
}

// Claim: a number that no state asked for in n - 1 steps, and the n-th step does, is as far from where it was
// as if it had moved all n times: the variance is n times that of one step, which is known, since
//   d = most exp(-u log(most / least)), either way:  E d^2 = (most^2 - least^2) / (2 log(most / least)),
//   E d^4 = (most^4 - least^4) / (4 log(most / least)),
// and the distribution that of numbers that were asked for each time (Kolmogorov and Smirnov, two samples).
// Rejected proposals move nothing. 15 comparisons at 5 standard errors and 15 at 1e-6: a false alarm in 5e-5
// of seeds. One step too many or too few is 20 to 700 standard errors away.
TEST(McmcState, WhatWasNotAskedForMakesUpForTheStepsItMissed) {
  constexpr StepSizes kSizes{1.0 / 512, 1.0 / 64};  // 24 of them do not get around half the circle
  constexpr std::uint64_t kStates = 40000;
  const double log_ratio = std::log(kSizes.most / kSizes.least);
  const double square = (std::pow(kSizes.most, 2) - std::pow(kSizes.least, 2)) / (2 * log_ratio);
  const double fourth = (std::pow(kSizes.most, 4) - std::pow(kSizes.least, 4)) / (4 * log_ratio);
  for (const std::uint64_t steps : {1, 2, 3, 8, 24}) {
    const auto n = static_cast<double>(steps);
    const Moved lazy = moved_by(steps, false, kStates, kSizes, 100 + steps);
    const Moved always = moved_by(steps, true, kStates, kSizes, 200 + steps);
    for (std::size_t k = 0; k < lazy.by.size(); ++k) {
      const auto& by = lazy.by[k];
      const double found = std::inner_product(by.begin(), by.end(), by.begin(), 0.0) / kStates;
      // The variance of the square of a sum of n independent steps.
      const double spread = n * fourth + 3 * n * (n - 1) * square * square - n * n * square * square;
      EXPECT_NEAR(found / (n * square), 1, 5 * std::sqrt(spread / kStates) / (n * square) + 1e-6)
          << steps << " steps, number " << k;
      EXPECT_GT(test::two_sample_kolmogorov_p(by, always.by[k]), 1e-6) << steps << " steps, number " << k;
    }
  }
}

}  // namespace
}  // namespace candela::mcmc
