// The table of primary samples: what a rejection undoes, what bytes hold, and how many.
#include <gtest/gtest.h>

#include "common/chains/chains.h"
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

}  // namespace
}  // namespace candela::mcmc
