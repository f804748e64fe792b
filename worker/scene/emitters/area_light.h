// The emitter that a surface makes: radiance from its front, the same towards all directions, over its shape.
//
// A Surface knows its geometry alone:
//   kNormalsVary    the normals point everywhere: a cone of them bounds nothing
//   kReadsRest      sample() and sample_area() read `rest`, what is left of the number that chose the emitter
//   reaches(p)      some of the front is visible from p; false is exact
//   sample(p, rest, u, LightPoint&)       a point as seen from p; false: none
//   pdf_solid_angle(p, SurfaceHit)        its density, by the reference and the point alone
//   sample_area(rest, u, LightPoint&)     a point uniform in area, density 1 / area(), as light paths start
//   find_uv(LightPoint&)                  fills uv where the two leave it out, since it costs an arc tangent
// Both fill p, ng and error. Surfaces emit from their front only. Surfaces with more than one way of sampling
// (points/point_sampler.h) have, for the others,
//   sample_by(PointSampler, p, front, rest, u, LightPoint&)         as sample()
//   pdf_by_solid_angle(PointSampler, p, front, SurfaceHit)
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "worker/core/math.h"
#include "worker/core/warp.h"
#include "worker/scene/emitters/choice/surface_lanes.h"
#include "worker/scene/emitters/emitter.h"
#include "worker/scene/emitters/light_bounds.h"
#include "worker/scene/emitters/light_point.h"
#include "worker/scene/emitters/points/point_sampler.h"
#include "worker/scene/emitters/scene_extent.h"
#include "worker/scene/emitters/surface_extent.h"
#include "worker/scene/shapes/geometry.h"
#include "worker/scene/textures/texture.h"

namespace candela::scene {

template <class Surface>
class AreaLight {
 public:
  static constexpr bool kInfinite = false;
  static constexpr bool kReadsRest = Surface::kReadsRest;

  // `shape` is in the geometry already.
  AreaLight(Surface surface, const SurfaceExtent& extent, const Geometry& geometry, std::uint32_t shape,
            const ColorTexture& radiance)
      : surface_(std::move(surface)),
        extent_(extent),
        radiance_(radiance),
        shape_(shape),
        bsdf_(geometry.shapes[shape].bsdf) {
    // A texture is bounded by its maximum: it must not be missed where it is bright.
    const double level = static_cast<double>(luminance(radiance.maximum()));
    strength_ =
        static_cast<float>(std::min(level * surface_.area() * static_cast<double>(extent.seen()), 1e30));
  }

  DirectOutcome sample_direct(const SurfaceHit& reference, Vec3 front, double rest, Vec2 u,
                              DirectSample& out) const;
  float pdf_direct_solid_angle(Vec3 reference, Vec3 /*d*/, const SurfaceHit& hit) const {
    return surface_.pdf_solid_angle(reference, hit);
  }
  // The same by another sampler of points; by the emitter's own if its surface does not have that one.
  DirectOutcome sample_direct_by(PointSampler sampler, const SurfaceHit& reference, Vec3 front, double rest,
                                 Vec2 u, DirectSample& out) const;
  float pdf_direct_by_solid_angle(PointSampler sampler, Vec3 reference, Vec3 front,
                                  const SurfaceHit& hit) const {
    if constexpr (kHasSamplers) {
      if (sampler != PointSampler::own) return surface_.pdf_by_solid_angle(sampler, reference, front, hit);
    }
    return pdf_direct_solid_angle(reference, {}, hit);
  }

  bool sample_emission(const SceneExtent& scene, double rest, Vec2 u_position, Vec2 u_direction,
                       EmissionSample& out) const;
  bool pdf_emission(const SceneExtent& scene, Vec3 ng, Vec3 d, EmissionDensity& out) const;

  // Radiance from the surface at `hit` towards wo.
  Spectrum emitted(const SurfaceHit& hit, Vec3 wo) const {
    return dot(wo, hit.ng) > 0 ? radiance_.eval(hit) : Spectrum();
  }

  Spectrum power(const SceneExtent& scene) const;
  // W, luminance: a texture whose light the quadrature of power() missed must still be found.
  double min_power() const {
    if (radiance_.is_constant()) return 0;
    return 1e-3 * static_cast<double>(luminance(radiance_.maximum())) * surface_.area();
  }
  LightBounds bounds(const Geometry& geometry) const;
  float importance(Vec3 p, Vec3 front) const {
    if (!surface_.reaches(p)) return 0;
    return extent_.template importance<!Surface::kNormalsVary>(strength_, p, front);
  }
  // The same, as SurfaceLanes computes it beside others.
  SurfaceLane lane() const {
    SurfaceLane out{
        .extent = extent_, .strength = strength_, .cone = !Surface::kNormalsVary, .corner = {}, .normal = {}};
    if constexpr (requires { surface_.plane(out.corner, out.normal); })
      surface_.plane(out.corner, out.normal);
    else
      out.ask = !Surface::kReachesAll;
    return out;
  }
  bool reaches(Vec3 p) const { return surface_.reaches(p); }

 private:
  static constexpr bool kHasSamplers = requires(const Surface& s, LightPoint& p) {
    s.sample_by(PointSampler::area, Vec3(), Vec3(), 0.0, Vec2(), p);
  };
  // The light that arrives from a sampled point.
  DirectOutcome direct(const SurfaceHit& reference, Vec3 front, LightPoint& point, DirectSample& out) const;
  float pdf_area() const { return static_cast<float>(1 / surface_.area()); }
  void sample_area(double rest, Vec2 u, LightPoint& out) const {
    surface_.sample_area(rest, u, out);
    if (!radiance_.is_constant()) surface_.find_uv(out);
  }
  Spectrum mean_radiance() const;

  Surface surface_;
  SurfaceExtent extent_;
  float strength_ = 0;  // importance at unit distance and cosines
  ColorTexture radiance_;
  std::uint32_t shape_, bsdf_;
};

template <class Surface>
DirectOutcome AreaLight<Surface>::sample_direct(const SurfaceHit& reference, Vec3 front, double rest, Vec2 u,
                                                DirectSample& out) const {
  LightPoint point;
  if (!surface_.sample(reference.p, rest, u, point)) return DirectOutcome::failed;
  return direct(reference, front, point, out);
}

template <class Surface>
DirectOutcome AreaLight<Surface>::sample_direct_by(PointSampler sampler, const SurfaceHit& reference,
                                                   Vec3 front, double rest, Vec2 u, DirectSample& out) const {
  if constexpr (kHasSamplers) {
    if (sampler != PointSampler::own) {
      LightPoint point;
      if (!surface_.sample_by(sampler, reference.p, front, rest, u, point)) return DirectOutcome::failed;
      return direct(reference, front, point, out);
    }
  }
  return sample_direct(reference, front, rest, u, out);
}

template <class Surface>
DirectOutcome AreaLight<Surface>::direct(const SurfaceHit& reference, Vec3 front, LightPoint& point,
                                         DirectSample& out) const {
  out.wi = point.wi;
  out.p = point.p;
  out.ng = point.ng;
  out.primitive = point.primitive;
  out.pdf_solid_angle = point.pdf_solid_angle;
  out.delta = false;
  out.infinite = false;
  if (!faces(front, point.wi)) {
    out.radiance = {};
    return DirectOutcome::dark;
  }
  if (!radiance_.is_constant()) surface_.find_uv(point);
  out.radiance = radiance_.eval(point);
  if (out.radiance.is_black()) return DirectOutcome::dark;
  out.shadow_ray = spawn_shadow_ray(reference, point.p, point.ng, point.error);
  return DirectOutcome::sampled;
}

template <class Surface>
bool AreaLight<Surface>::sample_emission(const SceneExtent& /*scene*/, double rest, Vec2 u_position,
                                         Vec2 u_direction, EmissionSample& out) const {
  LightPoint point;
  sample_area(rest, u_position, point);
  static_cast<SurfacePoint&>(out.vertex) = point;
  out.vertex.ng = point.ng;
  out.vertex.shading = make_frame(point.ng);
  out.vertex.error = point.error;
  out.vertex.shape = shape_;
  out.vertex.bsdf = bsdf_;
  const Vec3 d = normalize(out.vertex.shading.to_world(warp::cosine_hemisphere(u_direction)));
  out.radiance = radiance_.eval(point);
  out.cosine = dot(d, point.ng);
  if (!(out.cosine > 0)) return false;
  out.pdf_area = pdf_area();
  out.pdf_solid_angle = warp::pdf_cosine_hemisphere_solid_angle(out.cosine);
  out.ray = spawn_ray(out.vertex, d);
  return true;
}

template <class Surface>
bool AreaLight<Surface>::pdf_emission(const SceneExtent& /*scene*/, Vec3 ng, Vec3 d,
                                      EmissionDensity& out) const {
  out.cosine = dot(d, ng);
  if (!(out.cosine > 0) || !(out.prob > 0)) return false;
  out.pdf_area = pdf_area();
  out.pdf_solid_angle = warp::pdf_cosine_hemisphere_solid_angle(out.cosine);
  return true;
}

// The mean of a texture is that over a grid on the surface, triangles in turn by multiples of the golden
// ratio.
template <class Surface>
Spectrum AreaLight<Surface>::mean_radiance() const {
  if (radiance_.is_constant()) return radiance_.constant;
  constexpr std::uint32_t kSteps = 64;
  double sum[3] = {};
  for (std::uint32_t i = 0; i < kSteps * kSteps; ++i) {
    const Vec2 u{(static_cast<float>(i % kSteps) + 0.5f) / kSteps,
                 (static_cast<float>(i / kSteps) + 0.5f) / kSteps};
    const double turn = 0.6180339887498949 * (i + 0.5);
    LightPoint point;
    sample_area(turn - std::floor(turn), u, point);
    const Spectrum radiance = radiance_.eval(point);
    sum[0] += static_cast<double>(radiance.r);
    sum[1] += static_cast<double>(radiance.g);
    sum[2] += static_cast<double>(radiance.b);
  }
  constexpr double kEach = 1.0 / (kSteps * kSteps);
  return {static_cast<float>(sum[0] * kEach), static_cast<float>(sum[1] * kEach),
          static_cast<float>(sum[2] * kEach)};
}

template <class Surface>
Spectrum AreaLight<Surface>::power(const SceneExtent& /*scene*/) const {
  return mean_radiance() * static_cast<float>(static_cast<double>(math::kPi) * surface_.area());
}

template <class Surface>
LightBounds AreaLight<Surface>::bounds(const Geometry& geometry) const {
  LightBounds out;
  out.box = geometry.bounds_of_shape(shape_);
  out.axis = length_squared(extent_.axis) > 0 ? extent_.axis : Vec3(0, 0, 1);
  out.spread = math::acosf(extent_.cos_spread);
  out.emission = math::kPi / 2;
  out.strength = strength_;
  return out;
}

}  // namespace candela::scene
