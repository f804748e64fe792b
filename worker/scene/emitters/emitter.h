// Emitters as the transport layer sees them.
//
// Every emitter has an index. Light may be seen from a point (DirectSample) or followed from its source
// (EmissionSample). Discrete choices are named: where a density would be a delta function, a flag says so and
// its place is taken by 1, the probability of the only choice there is.
#pragma once

#include <cstdint>

#include "worker/core/vec.h"
#include "worker/scene/hit.h"

namespace candela::scene {

// The outcome of choosing a direction towards light. All three are draws that an estimator counts.
enum class DirectOutcome : std::uint8_t {
  sampled,  // light arrives along it, unless something is in between
  dark,     // the direction has its density, but no light arrives along it: below the horizon of `front`,
            // outside of a spot's cone, at a black texel. DirectSample::shadow_ray is not filled
  failed,   // there is no direction: nothing can light the point by this choice, or the point that was
            // chosen has no density per solid angle (seen from behind). DirectSample is not filled
};

// True if light from wi counts at a scattering side `front` (see Scene::sample_direct; zero: both sides).
inline bool faces(Vec3 front, Vec3 wi) {
  return (front.x == 0 && front.y == 0 && front.z == 0) || dot(front, wi) > 0;
}

// A direction towards light chosen at a reference point.
struct DirectSample {
  Vec3 wi;            // unit, world, from the reference point
  Spectrum radiance;  // arriving along -wi, unoccluded. Delta emitters: radiance * solid angle in the limit
                      // (intensity / r^2, irradiance)
  // Includes the choice of emitter. For delta emitters it is the discrete probability of that choice.
  float pdf_solid_angle = 0;
  bool delta = false;
  bool infinite = false;  // from outside the scene: p means nothing
  std::uint32_t emitter = kNone;
  Ray shadow_ray;                   // from the offset reference point, ends just before the light
  Vec3 p;                           // on the light
  Vec3 ng;                          // unit, of the emitting front; zero where there is no surface
  std::uint32_t primitive = kNone;  // of the surface, as in SurfaceHit; set where the density reads it
};

// Densities with which sample_emission chooses the start and direction of light.
struct EmissionDensity {
  float prob = 0;      // discrete, of the choice of emitter; of all environments together
  float pdf_area = 0;  // of the position: per area of the surface, or (infinite) of the disk across the
                       // direction that covers the scene; 1 where delta_position
  float pdf_solid_angle = 0;  // of the direction, given the position; 1 where delta_direction
  float cosine = 0;           // between direction and surface normal; 1 where there is no surface
  bool delta_position = false, delta_direction = false;
  bool infinite = false;  // directional, constant, envmap: light from outside the scene
};

// Light leaving an emitter.
struct EmissionSample : EmissionDensity {
  // Its start: p, ng, shading, uv, error, shape, bsdf and emitter as a ray meeting the emitter there
  // would find them (distance is not set; primitive is set by meshes only). Without a surface: ng is the
  // direction.
  SurfaceHit vertex;
  Ray ray;            // offset off the surface; infinite: from outside the scene's bounding sphere
  Spectrum radiance;  // along the ray, W / (m^2 sr); delta_position: intensity, W / sr; delta_direction:
                      // irradiance across the direction, W / m^2
  Spectrum weight;    // radiance * cosine / (prob * pdf_area * pdf_solid_angle): the mean is the power, W
};

}  // namespace candela::scene
