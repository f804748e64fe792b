// Primary sample space [Kelemen 2002]: the state is the sequence of random numbers that an estimator draws,
// a proposal is other numbers. The estimator asks for them by dimension, as of a sampler, so the state is a
// table of dimensions for each of its walks, grown when a dimension is first asked for.
//
// Large steps replace all numbers by those of the mutation's key: nothing is stored, and a rejected one has
// nothing to undo. Small steps move each number by a distance that is symmetric in both directions:
// exponentially distributed between two bounds [Kelemen 2002, Sec. 3.2], around the unit circle. Numbers are
// 32-bit integers, so that this is exact and uniformity is preserved exactly.
//
// A number that the present state's path did not ask for is not moved. It remembers when it last moved (in
// accepted small steps since the last accepted large step), and makes up for the steps it missed when asked
// for again: what a proposal asks for is then distributed as if all numbers had moved all the time. What was
// made up for stays when the proposal is rejected, only the step itself is undone: to forget it would draw
// the past anew because of how it ended.
//
// Dimensions from kMaxDimensions on are not stored, which bounds a state: they are a function of the key of
// the last accepted large step, and small steps leave them where they are. That is as symmetric as any step;
// large steps alone explore them.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/rng/stream.h"
#include "worker/core/vec.h"

namespace candela::mcmc {

// A draw's two numbers as fractions of 2^32; draws of one number use x.
struct Point {
  std::uint32_t x = 0, y = 0;
};

// The small step's distances, as fractions of the unit interval.
struct StepSizes {
  double least = 1.0 / 1024, most = 1.0 / 64;
};

class PrimaryState;

// The numbers of one walk; stands in for samplers::Sampler.
class PrimarySampler {
 public:
  float draw_1d(std::uint32_t dimension, bool /*stratified*/) {
    return rng::to_float(read<false>(dimension).x);
  }
  Vec2 draw_2d(std::uint32_t dimension, bool /*stratified*/) {
    const Point p = read<true>(dimension);
    return {rng::to_float(p.x), rng::to_float(p.y)};
  }
  // That small steps never change. Of dimensions that are not drawn otherwise.
  double draw_fixed(std::uint32_t dimension) const;
  // Only names what goes to a film by itself, which a chain's samples do not.
  static std::uint64_t sample_key() { return 0; }

  static constexpr std::uint32_t kMaxDimensions = 1920;

 private:
  friend class PrimaryState;
  struct Entry {
    Point value, before;      // before: the proposal under way
    std::uint64_t time = 0;   // small steps taken
    std::uint64_t epoch = 0;  // the accepted large step that the value stems from; 0: none
    std::uint64_t stamp = 0;  // of the proposal that last moved it
  };

  static Point fresh(std::uint64_t key, std::uint32_t dimension) {
    const std::uint64_t h =
        rng::mix64(key + (static_cast<std::uint64_t>(dimension) + 1) * 0x9e3779b97f4a7c15ULL);
    return {static_cast<std::uint32_t>(h), static_cast<std::uint32_t>(h >> 32)};
  }
  template <bool kPair>
  Point read(std::uint32_t dimension);
  template <bool kPair>
  void move(Point& p, std::uint64_t random) const;

  PrimaryState* state_ = nullptr;
  std::uint64_t base_key_ = 0;      // of the last accepted large step
  std::uint64_t proposal_key_ = 0;  // of the proposal under way
  std::vector<Entry> entries_;
  std::vector<std::uint32_t> moved_;  // by the proposal under way
};

class PrimaryState {
 public:
  // Kinds of walks of an estimator.
  enum Walk : std::uint8_t { eye, light, choice };
  static constexpr std::size_t kWalks = 3;

  explicit PrimaryState(StepSizes sizes);
  PrimaryState(const PrimaryState&) = delete;
  PrimaryState& operator=(const PrimaryState&) = delete;

  PrimarySampler& walk(Walk which) { return samplers_[which]; }

  // All numbers those of the key.
  void start(std::uint64_t key);
  // From here to accept() or reject() the samplers give the proposal's numbers; otherwise the present ones.
  void propose(std::uint64_t key, bool large);
  void accept();
  void reject();

  std::string save() const;
  Result<void> restore(std::string_view bytes);

 private:
  friend class PrimarySampler;
  enum class Mode : std::uint8_t { present, small, large };

  void set_base(std::uint64_t key);

  std::array<PrimarySampler, kWalks> samplers_;
  Mode mode_ = Mode::present;
  std::uint64_t base_ = 0, proposal_ = 0;  // keys
  std::uint64_t now_ = 0;                  // small steps accepted since the last accepted large step
  std::uint64_t epoch_ = 1;                // of it
  std::uint64_t stamp_ = 0;                // of the last proposal
  double most_ = 0, log_ratio_ = 0;        // of step sizes
};

}  // namespace candela::mcmc
