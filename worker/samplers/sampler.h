// Samplers: pure functions of (seed, half, index, pixel, dimension). start() names the sample; each draw takes the next
// dimension. Every path vertex owns a fixed block of dimensions, so that two samples of one pixel use the same dimension
// for the same decision.
#pragma once

#include <cstdint>

#include "common/rng/stream.h"
#include "worker/core/vec.h"

namespace candela::samplers {

enum class SamplerKind : std::uint8_t { independent, sobol };

class Sampler {
 public:
  Sampler(SamplerKind kind, std::uint64_t seed) : kind_(kind), seed_(seed) {}

  // Sample `index` of the sequence of this pixel in this half. Halves use independent scrambles: their means are
  // independent estimates.
  void start(std::uint32_t half, std::uint64_t index, std::uint32_t x, std::uint32_t y);
  // Jump to a dimension (start of a vertex's block). Dimensions are counted in draws, 1D and 2D alike count one.
  void set_dimension(std::uint32_t dimension) { dimension_ = dimension; }
  float next_1d();
  Vec2 next_2d();
  // Names the sample: seeds the film's rounding.
  std::uint64_t sample_key() const { return sample_key_; }

 private:
  SamplerKind kind_;
  std::uint64_t seed_;
  std::uint64_t pixel_key_ = 0;   // (seed, half, pixel): scrambles
  std::uint64_t sample_key_ = 0;  // (seed, half, pixel, index)
  std::uint64_t index_ = 0;
  std::uint32_t dimension_ = 0;
};

}  // namespace candela::samplers
