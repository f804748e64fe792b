// What happens to light between two vertices of a path: surfaces it passes straight, media it crosses.
#pragma once

#include <algorithm>
#include <cmath>

#include "common/rng/stream.h"
#include "worker/integrators/path/techniques.h"
#include "worker/scene/scene.h"

namespace candela::integrators::path {

// The fraction of light that gets along a shadow ray, from `medium`. Straight passes are taken in their
// expectation; media in closed form or by an unbiased estimate from the stream.
template <Between kBetween, class SceneT>
Spectrum passing(const SceneT& scene, Ray ray, std::uint32_t medium, rng::Stream stream,
                 std::uint64_t& rays) {
  Spectrum fraction(1.0f);
  // A ray that ends somewhere is aimed at its end anew behind each surface: the offsets from those surfaces
  // add up, and must not carry it into the light.
  const bool ends = ray.t_max < 1e30f;
  const Vec3d end = Vec3d(ray.origin) + Vec3d(ray.direction) * static_cast<double>(ends ? ray.t_max : 0);
  for (std::uint32_t passes = 0; passes < kMostPasses; ++passes) {
    scene::SurfaceHit hit;
    ++rays;
    const bool found = scene.intersect(ray, hit);
    if (found) {
      fraction *= scene.straight(hit, -ray.direction);
      if (fraction.is_black()) return {};
    }
    if constexpr (kBetween == Between::media) {
      if (medium != scene::kNone) {
        const Ray crossed = {ray.origin, ray.direction, found ? hit.distance : ray.t_max};
        fraction *= scene.medium(medium).transmittance(crossed, stream);
        if (fraction.is_black()) return {};
      }
    }
    if (!found) return fraction;
    if constexpr (kBetween == Between::media) medium = scene.medium_beyond(hit, ray.direction, medium);
    const Vec3 direction = ray.direction;
    ray = spawn_ray(hit, direction);
    if (ends) {
      const Vec3d rest = end - Vec3d(ray.origin);
      const double distance = length(rest);
      if (!(dot(rest, Vec3d(direction)) > 0) || !(distance > 0)) return fraction;
      ray = {ray.origin, Vec3(rest / distance), static_cast<float>(distance * (1 - 0x1p-22))};
    }
  }
  return {};
}

// The place of a scattering in a medium, as sample_direct wants it: no surface, both sides count. It keeps
// off the surface `end` (null: none) that the ray goes on to, by more than rounding: the medium's other side
// must not be reached without crossing it.
inline void medium_vertex(const Ray& ray, float distance, const scene::SurfaceHit* end,
                          scene::SurfaceHit& vertex) {
  if (end != nullptr) {
    const float margin = 2 * end->error / std::max(std::abs(dot(ray.direction, end->ng)), 1e-3f);
    distance = std::min(distance, std::max(end->distance - margin, 0.5f * end->distance));
  }
  const Vec3 p = ray.origin + ray.direction * distance;
  vertex = {};
  vertex.p = p;
  vertex.ng = ray.direction;  // not read but where a shadow ray has no length
}

}  // namespace candela::integrators::path
