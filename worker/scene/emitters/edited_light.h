// A lamp whose light edits turn as it leaves [docs/edits.md; retargeting note, section 2]: edits of light
// whose expression ends with L. The scene puts it in the place of the lamp.
//
// As at surfaces (bsdfs/edited.h) the light along o is a sum over branches w_b, which it may have been meant
// for: L(w_b) |w_b.n| / |o.n| J_b of a surface of normal n, and I(w_b) J_b of a point. A light path draws w
// as the lamp does, and leaves along M(w).
#pragma once

#include <cstdint>
#include <memory>

#include "worker/core/vec.h"
#include "worker/scene/emitters/emitter.h"
#include "worker/scene/emitters/light_bounds.h"
#include "worker/scene/emitters/points/point_sampler.h"
#include "worker/scene/emitters/scene_extent.h"
#include "worker/scene/shapes/geometry.h"

namespace candela::scene {

struct EditedClosure;
struct SceneEdits;
struct NestedEmitter;  // of emitter_set.h, which has this kind among its own

class EditedLight {
 public:
  static constexpr bool kInfinite = false;

  // bits: of the edits that turn it. The lamp is not infinite. scene_size: of the largest coordinate.
  EditedLight(std::shared_ptr<const NestedEmitter> nested, const SceneEdits& edits, std::uint16_t bits,
              double scene_size);

  bool reads_rest() const;
  DirectOutcome sample_direct(const SurfaceHit& reference, Vec3 front, double rest, Vec2 u,
                              DirectSample& out) const;
  float pdf_direct_solid_angle(Vec3 reference, Vec3 d, const SurfaceHit& hit) const;
  DirectOutcome sample_direct_by(PointSampler sampler, const SurfaceHit& reference, Vec3 front, double rest,
                                 Vec2 u, DirectSample& out) const;
  float pdf_direct_by_solid_angle(PointSampler sampler, Vec3 reference, Vec3 front,
                                  const SurfaceHit& hit) const;

  bool sample_emission(const SceneExtent& scene, double rest, Vec2 u_position, Vec2 u_direction,
                       EmissionSample& out) const;
  // p: where the light leaves.
  bool pdf_emission_at(const SceneExtent& scene, Vec3 p, Vec3 ng, Vec3 d, EmissionDensity& out) const;
  Spectrum emitted(const SurfaceHit& hit, Vec3 wo) const;

  // The choice of lamps knows no edits: it takes the unedited lamp, a point as if it shone everywhere.
  Spectrum power(const SceneExtent& scene) const;
  double min_power() const;
  float importance(Vec3 p, Vec3 front) const;
  LightBounds bounds(const Geometry& geometry) const;
  bool reaches(Vec3 p) const;

 private:
  // The place that light leaves. ng: zero of a point.
  EditedClosure at(Vec3 p, Vec3 ng) const;
  DirectOutcome turn(DirectOutcome outcome, DirectSample& out) const;
  DirectOutcome sample_point(const SurfaceHit& reference, Vec3 front, DirectSample& out) const;

  std::shared_ptr<const NestedEmitter> nested_;
  const SceneEdits* edits_;
  std::uint16_t bits_;
  float error_;  // of places
  bool point_ = false;
  Vec3 position_;       // of a point
  float strength_ = 0;  // its importance at unit distance and cosine
};

}  // namespace candela::scene
