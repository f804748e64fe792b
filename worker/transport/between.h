// Transmittance between two vertices of a path: surfaces that light passes straight, media.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <type_traits>

#include "common/rng/stream.h"
#include "worker/scene/scene.h"

namespace candela::transport {

// Content of the edges of paths. Each value includes the ones before it.
enum class EdgeContent : std::uint8_t {
  nothing,   // a ray meets what it hits
  surfaces,  // that light may pass straight: null, mask, thin glass
  media
};

// Surfaces that one path or shadow ray may pass straight; where rounding kept a ray from getting on, it ends.
inline constexpr std::uint32_t kMaxPasses = 1u << 16;

// The probability with which a walk passes a stretch of a medium, as weights know it: a deterministic
// function of the stretch, the same for walks of both directions. 1 where it has no closed form. Any such
// function leaves weights that sum to one; a good one makes them good.
inline float stretch_survival(const scene::Medium& medium, const Ray& stretch) {
  return medium.homogeneous() ? medium.prob_pass(stretch.t_max, Spectrum(1.0f)) : 1.0f;
}

// The part of the ray, up to the surface `end` (null: none), that a medium fills. Rays start off their
// surface by its error, so that the medium ends off the next one by as much: seen from all sides it is the
// same medium, thinner by what rounding cannot tell, and a vertex inside never lies beyond a surface
// unnoticed. That matters where mean free paths are hardly longer than the error.
inline Ray inside_medium(const Ray& ray, const scene::SurfaceHit* end) {
  if (end == nullptr) return ray;
  const float cosine = std::max(std::abs(dot(ray.direction, end->ng)), 1e-6f);
  return {ray.origin, ray.direction, std::max(0.0f, end->distance - end->error / cosine)};
}

// In place of a LightReach (dense_medium.h): light passes as far as the medium lets it.
struct NoLightReach {};

// The fraction of light that gets along a shadow ray, from `medium`. Straight passes are taken in their
// expectation; media in closed form or by an unbiased estimate from the stream. `survival`, where asked for,
// is multiplied by what stretch_survival says of each stretch. reach: of the first stretch.
template <EdgeContent kEdgeContent, class SceneT, class Reach = NoLightReach>
Spectrum passing(const SceneT& scene, Ray ray, std::uint32_t medium, rng::Stream stream, std::uint64_t& rays,
                 double* survival = nullptr, const Reach* reach = nullptr) {
  constexpr bool kEnds = !std::is_same_v<Reach, NoLightReach>;
  if constexpr (kEnds) {
    if (reach->ends_in_medium() && reach->distance() < ray.t_max) return {};
  }
  Spectrum fraction(1.0f);
  // A ray that ends somewhere is aimed at its end anew behind each surface: the offsets from those surfaces
  // add up, and must not carry it into the light.
  const bool ends = ray.t_max < 1e30f;
  const Vec3d end = Vec3d(ray.origin) + Vec3d(ray.direction) * static_cast<double>(ends ? ray.t_max : 0);
  for (std::uint32_t passes = 0; passes < kMaxPasses; ++passes) {
    scene::SurfaceHit hit;
    ++rays;
    Ray part = ray;
    if constexpr (kEnds) {
      if (passes == 0) part.t_max = std::min(ray.t_max, reach->distance());
    }
    const bool found = scene.intersect(part, hit);
    if constexpr (kEnds) {
      if (passes == 0) {
        if (!found && part.t_max < ray.t_max) return {};
        fraction *= static_cast<float>(1 / reach->prob(found ? hit.distance : ray.t_max));
      }
    }
    if (found) {
      fraction *= scene.passthrough(hit, -ray.direction);
      if (fraction.is_black()) return {};
    }
    if constexpr (kEdgeContent == EdgeContent::media) {
      if (medium != scene::kNone) {
        const Ray stretch = inside_medium(ray, found ? &hit : nullptr);
        fraction *= scene.medium(medium).transmittance(stretch, stream);
        if (fraction.is_black()) return {};
        if (survival != nullptr)
          *survival *= static_cast<double>(stretch_survival(scene.medium(medium), stretch));
      }
    }
    if (!found) return fraction;
    if constexpr (kEdgeContent == EdgeContent::media)
      medium = scene.medium_beyond(hit, ray.direction, medium);
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

// The place of a scattering in a medium, as sample_direct wants it: no surface, both sides count.
inline void medium_vertex(const Ray& ray, float distance, scene::SurfaceHit& vertex) {
  vertex = {};
  vertex.p = ray.origin + ray.direction * distance;
  vertex.ng = ray.direction;  // not read but where a shadow ray has no length
}

}  // namespace candela::transport
