#include "worker/scene/emitters/edited_light.h"

#include <utility>

#include "worker/core/math.h"
#include "worker/scene/bsdfs/edited_branches.h"
#include "worker/scene/emitters/cone_importance.h"
#include "worker/scene/emitters/emitter_set.h"
#include "worker/scene/emitters/place.h"

namespace candela::scene {

struct NestedEmitter {
  Emitter emitter;
};

using edited::Branch;
using edited::Branches;

namespace {

template <class Light>
concept Point = requires(const Light& light) {
  light.position();
  light.intensity(Vec3());
};

// The places of an edit's rays are as imprecise as those of any surface.
constexpr double kError = 0x1p-18;

// Any axis serves a cone of all directions.
constexpr float kAllDirections = -2;

}  // namespace

Emitter edited_light(Emitter light, const SceneEdits& edits, std::uint16_t bits, double scene_size) {
  return EditedLight(std::make_shared<const NestedEmitter>(std::move(light)), edits, bits, scene_size);
}

EditedLight::EditedLight(std::shared_ptr<const NestedEmitter> nested, const SceneEdits& edits,
                         std::uint16_t bits, double scene_size)
    : nested_(std::move(nested)),
      edits_(&edits),
      bits_(bits),
      error_(static_cast<float>(kError * scene_size)) {
  visit_emitter(nested_->emitter, [&]<class Light>(const Light& light) {
    if constexpr (Point<Light>) {
      point_ = true;
      position_ = light.position();
      strength_ = luminance(light.peak());
    }
  });
}

EditedClosure EditedLight::at(Vec3 p, Vec3 ng) const {
  if (point_) return {nullptr, edits_, nullptr, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, p, {}, error_};
  return {nullptr, edits_, nullptr, make_frame(ng), p, {0, 0, 1}, error_};
}

bool EditedLight::reads_rest() const {
  return visit_emitter(nested_->emitter, [](const auto& light) {
    if constexpr (requires { light.reads_rest(); })
      return light.reads_rest();
    else
      return light.kReadsRest;
  });
}

// ---- light seen from a point

// The edits turn light that a surface sends. Its radiance is the same in all directions of its front.
DirectOutcome EditedLight::turn(DirectOutcome outcome, DirectSample& out) const {
  if (outcome != DirectOutcome::sampled) return outcome;
  const EditedClosure place = at(out.p, out.ng);
  const Vec3 o = place.shading.to_local(-out.wi);
  Branches branches;
  edited::undo(place, bits_, o, branches);
  Spectrum sum;
  for (std::uint32_t b = 0; b < branches.count; ++b) {
    const Branch& branch = branches.at[b];
    if (branch.w.z > 0) sum += branch.factor * static_cast<float>(edited::gamma(place, o, branch));
  }
  out.radiance *= sum;
  return out.radiance.is_black() ? DirectOutcome::dark : DirectOutcome::sampled;
}

DirectOutcome EditedLight::sample_point(const SurfaceHit& reference, Vec3 front, DirectSample& out) const {
  const EditedClosure place = at(position_, {});
  const auto intensity = [&](Vec3 d) {
    Branches branches;
    edited::undo(place, bits_, d, branches);
    return visit_emitter(nested_->emitter, [&]<class Light>(const Light& light) {
      Spectrum sum;
      if constexpr (Point<Light>) {
        for (std::uint32_t b = 0; b < branches.count; ++b) {
          const Branch& branch = branches.at[b];
          sum +=
              light.intensity(branch.w) * branch.factor * static_cast<float>(edited::gamma(place, d, branch));
        }
      }
      return sum;
    });
  };
  return sample_place(position_, reference, front, intensity, out);
}

DirectOutcome EditedLight::sample_direct(const SurfaceHit& reference, Vec3 front, double rest, Vec2 u,
                                         DirectSample& out) const {
  if (point_) return sample_point(reference, front, out);
  return turn(
      visit_emitter(nested_->emitter,
                    [&](const auto& light) { return light.sample_direct(reference, front, rest, u, out); }),
      out);
}

DirectOutcome EditedLight::sample_direct_by(PointSampler sampler, const SurfaceHit& reference, Vec3 front,
                                            double rest, Vec2 u, DirectSample& out) const {
  if (point_) return sample_point(reference, front, out);
  return turn(visit_emitter(nested_->emitter,
                            [&](const auto& light) {
                              if constexpr (requires {
                                              light.sample_direct_by(sampler, reference, front, rest, u, out);
                                            })
                                return light.sample_direct_by(sampler, reference, front, rest, u, out);
                              else
                                return light.sample_direct(reference, front, rest, u, out);
                            }),
              out);
}

float EditedLight::pdf_direct_solid_angle(Vec3 reference, Vec3 d, const SurfaceHit& hit) const {
  return visit_emitter(nested_->emitter,
                       [&](const auto& light) { return light.pdf_direct_solid_angle(reference, d, hit); });
}

float EditedLight::pdf_direct_by_solid_angle(PointSampler sampler, Vec3 reference, Vec3 front,
                                             const SurfaceHit& hit) const {
  return visit_emitter(nested_->emitter, [&](const auto& light) {
    if constexpr (requires { light.pdf_direct_by_solid_angle(sampler, reference, front, hit); })
      return light.pdf_direct_by_solid_angle(sampler, reference, front, hit);
    else
      return light.pdf_direct_solid_angle(reference, {}, hit);
  });
}

Spectrum EditedLight::emitted(const SurfaceHit& hit, Vec3 wo) const {
  if (point_) return {};
  const EditedClosure place = at(hit.p, hit.ng);
  const Vec3 o = place.shading.to_local(wo);
  Branches branches;
  edited::undo(place, bits_, o, branches);
  return visit_emitter(nested_->emitter, [&](const auto& light) {
    Spectrum sum;
    if constexpr (requires { light.emitted(hit, wo); }) {
      for (std::uint32_t b = 0; b < branches.count; ++b) {
        const Branch& branch = branches.at[b];
        // Every direction of the front has the light of the normal.
        if (branch.w.z > 0)
          sum += light.emitted(hit, hit.ng) * branch.factor *
                 static_cast<float>(edited::gamma(place, o, branch));
      }
    }
    return sum;
  });
}

// ---- light as it leaves

bool EditedLight::pdf_emission_at(const SceneExtent& scene, Vec3 p, Vec3 ng, Vec3 d,
                                  EmissionDensity& out) const {
  const EditedClosure place = at(p, ng);
  Branches branches;
  edited::undo(place, bits_, place.shading.to_local(d), branches);
  EmissionDensity found = out;
  double pdf = 0;
  for (std::uint32_t b = 0; b < branches.count; ++b) {
    EmissionDensity one = out;
    const Vec3 w = place.shading.to_world(branches.at[b].w);
    if (!visit_emitter(nested_->emitter, [&](const auto& light) {
          if constexpr (requires { light.pdf_emission(scene, ng, w, one); })
            return light.pdf_emission(scene, ng, w, one);
          else
            return false;  // an edited lamp, which is nested in none
        }))
      continue;
    pdf += static_cast<double>(one.pdf_solid_angle) * branches.at[b].jacobian;
    found = one;
  }
  out = found;
  out.pdf_solid_angle = static_cast<float>(pdf);
  out.cosine = point_ ? 1 : dot(d, ng);
  return pdf > 0 && out.cosine > 0 && out.prob > 0;
}

bool EditedLight::sample_emission(const SceneExtent& scene, double rest, Vec2 u_position, Vec2 u_direction,
                                  EmissionSample& out) const {
  if (!visit_emitter(nested_->emitter, [&](const auto& light) {
        return light.sample_emission(scene, rest, u_position, u_direction, out);
      }))
    return false;
  const Vec3 p = out.vertex.p, ng = point_ ? Vec3{} : out.vertex.ng;
  const EditedClosure place = at(p, ng);
  Vec3 o = place.shading.to_local(out.ray.direction);
  if (!edited::apply(place, bits_, o)) return false;
  const Vec3 d = normalize(place.shading.to_world(o));
  Branches branches;
  edited::undo(place, bits_, o, branches);
  Spectrum sum;
  for (std::uint32_t b = 0; b < branches.count; ++b) {
    const Branch& branch = branches.at[b];
    Spectrum radiance = out.radiance;
    if (point_)
      visit_emitter(nested_->emitter, [&]<class Light>(const Light& light) {
        if constexpr (Point<Light>) radiance = light.intensity(branch.w);
      });
    else if (!(branch.w.z > 0))
      continue;
    sum += radiance * branch.factor * static_cast<float>(edited::gamma(place, o, branch));
  }
  out.radiance = sum;
  if (!pdf_emission_at(scene, p, ng, d, out)) return false;  // at the rim of a cone, by rounding
  if (point_)
    start_at(p, d, out);
  else
    out.ray = spawn_ray(out.vertex, d);
  return true;
}

// ---- facts

Spectrum EditedLight::power(const SceneExtent& scene) const {
  return visit_emitter(nested_->emitter, [&](const auto& light) { return light.power(scene); });
}

double EditedLight::min_power() const {
  return visit_emitter(nested_->emitter, [](const auto& light) {
    if constexpr (requires { light.min_power(); })
      return light.min_power();
    else
      return 0.0;
  });
}

float EditedLight::importance(Vec3 p, Vec3 front) const {
  if (point_) return cone_importance(strength_, position_ - p, front, {0, 0, 1}, kAllDirections);
  return visit_emitter(nested_->emitter, [&](const auto& light) { return light.importance(p, front); });
}

LightBounds EditedLight::bounds(const Geometry& geometry) const {
  LightBounds out = visit_emitter(nested_->emitter, [&](const auto& light) {
    if constexpr (requires { light.bounds(geometry); })
      return light.bounds(geometry);
    else
      return LightBounds();
  });
  if (!point_) return out;
  out.axis = {0, 0, 1};
  out.spread = math::kPi;
  out.emission = 0;
  out.strength = strength_;
  return out;
}

bool EditedLight::reaches(Vec3 p) const {
  return visit_emitter(nested_->emitter, [&](const auto& light) {
    if constexpr (requires { light.reaches(p); })
      return light.reaches(p);
    else
      return true;
  });
}

}  // namespace candela::scene
