// The dimension of the sampler for each random number of a path. The start's come first (eye: film
// position and lens; light: choice and place, direction, ...), then a block for each stretch of a ray.
#pragma once

#include <cstddef>
#include <cstdint>

#include "worker/core/vec.h"

namespace candela::transport {

inline constexpr std::uint32_t kEyeDimensions = 2, kLightDimensions = 3;

// The block of walk.h. kEmitterChoice and kEmitterPoint: next event estimation; kLens: connections to the
// camera, of which a walk makes one or the other.
inline constexpr std::uint32_t kLobe = 0, kDirection = 1, kRoulette = 2, kFlight = 3, kEmitterChoice = 4,
                               kEmitterPoint = 5, kLens = 5, kTransmittance = 6, kLensFlight = 7, kBlock = 8;

// The block of the path tracer (estimators/path.h), whose loop has other draws: kFlight and kTransmittance
// are there only if the scene has media.
namespace path_block {
inline constexpr std::uint32_t kEmitterChoice = 0, kEmitterPoint = 1, kLobe = 2, kDirection = 3,
                               kRoulette = 4, kFlight = 5, kTransmittance = 6, kBlock = 5, kMediaBlock = 7;
// First dimension of light technique i > 0 at one vertex; beyond all path dimensions.
constexpr std::uint32_t further_light(std::size_t i) {
  return (1u << 30) + static_cast<std::uint32_t>(i) * kMediaBlock;
}
// Dimensions from one group of lights of a vertex to the next; beyond all path dimensions.
inline constexpr std::uint32_t kNextGroup = 1u << 29;
}  // namespace path_block

// Only the first vertices that are not specular use stratified samples: later ones gain less than they cost.
inline constexpr std::uint32_t kStratifiedVertices = 2;

// The random numbers of one vertex. SamplerT: samplers::Sampler, or what stands in for it.
template <class SamplerT>
struct VertexDraws {
  SamplerT& sampler;
  std::uint32_t block;  // its first dimension
  bool stratified;

  float draw_1d(std::uint32_t which) const { return sampler.draw_1d(block + which, stratified); }
  Vec2 draw_2d(std::uint32_t which) const { return sampler.draw_2d(block + which, stratified); }
};

}  // namespace candela::transport
