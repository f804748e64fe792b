#include "worker/scene/emitters/lights.h"

#include <algorithm>

#include "worker/scene/emitters/light_groups.h"

namespace candela::scene {

void Lights::edit(std::uint32_t emitter, const SceneEdits& edits, std::uint16_t bits) {
  const Vec3d center = geometry_->bounds.center();
  emitters_.edit(emitter, edits, bits, geometry_->bounds.radius() + length(center));
}

void Lights::finish() {
  extent_.center = geometry_->bounds.center();
  extent_.radius = std::max(geometry_->bounds.radius(), 1e-12) * (1 + 1e-5);
  std::vector<double> powers;
  powers.reserve(emitters_.size());
  for (std::uint32_t i = 0; i < emitters_.size(); ++i)
    powers.push_back(emitters_.weight_of_power(i, extent_));
  by_power_ = PowerChooser(powers);
  uniform_ = UniformChooser(emitters_.size());
  draws_choice_ = emitters_.size() > 1 || (emitters_.size() == 1 && emitters_.reads_rest(0));
  if (emitters_.size() <= ImportanceChooser::kMaxEmitters) return by_importance_.finish();
  adapted_ = Adapted::tree;
  by_tree_ = TreeChooser(emitters_, *geometry_, powers);
}

Spectrum Lights::environment(Vec3 d) const {
  Spectrum sum;
  for (const std::uint32_t i : emitters_.environments()) sum += emitters_.environment(i).radiance(d);
  return sum;
}

template <class F>
decltype(auto) Lights::with_chooser(LightTechnique technique, const F& f) const {
  if (technique == LightTechnique::uniform) return f(uniform_);
  if (technique == LightTechnique::power) return f(by_power_);
  if (adapted_ == Adapted::tree) return f(by_tree_);
  return f(by_importance_);
}

// ---- light seen from a point

bool Lights::choose(Vec3 p, Vec3 front, double u, LightTechnique technique, EmitterChoice& out) const {
  out.rest = u;
  return emitters_.size() == 1 ||
         with_chooser(technique, [&](const auto& chooser) { return chooser.choose(p, front, u, out); });
}

DirectOutcome Lights::sample(const SurfaceHit& reference, Vec3 front, float u_select, Vec2 u,
                             DirectSample& out, LightTechnique technique, PointSampler point) const {
  if (emitters_.empty()) return DirectOutcome::failed;
  EmitterChoice choice{0, 1.0f, 0.0};
  if (draws_choice_ && !choose(reference.p, front, extend_draw(u_select, u.x, u.y), technique, choice))
    return DirectOutcome::failed;
  out.emitter = choice.emitter;
  const DirectOutcome outcome =
      point == PointSampler::own
          ? emitters_.sample_direct(choice.emitter, reference, front, choice.rest, u, out)
          : emitters_.sample_direct_by(point, choice.emitter, reference, front, choice.rest, u, out);
  if (outcome == DirectOutcome::failed) return outcome;
  out.pdf_solid_angle *= choice.prob;
  if (emitters_.environments().size() > 1 && emitters_.is_environment(choice.emitter)) [[unlikely]] {
    // Light of all environments arrives from one direction, whichever of them proposed it.
    out.pdf_solid_angle = pdf_environment_solid_angle(reference, front, out.wi, technique);
    out.radiance = faces(front, out.wi) ? environment(out.wi) : Spectrum();
    return out.radiance.is_black() ? DirectOutcome::dark : DirectOutcome::sampled;
  }
  return outcome;
}

float Lights::prob(Vec3 p, Vec3 front, std::uint32_t emitter, LightTechnique technique) const {
  if (emitters_.size() == 1) return 1;
  return with_chooser(technique, [&](const auto& chooser) { return chooser.prob(p, front, emitter); });
}

float Lights::pdf_solid_angle(const SurfaceHit& reference, Vec3 front, Vec3 d, const SurfaceHit& hit,
                              LightTechnique technique) const {
  const float pdf = emitters_.pdf_direct_solid_angle(hit.emitter, reference.p, d, hit);
  return pdf > 0 ? pdf * prob(reference.p, front, hit.emitter, technique) : 0.0f;
}

float Lights::pdf_environment_solid_angle(const SurfaceHit& reference, Vec3 front, Vec3 d,
                                          LightTechnique technique) const {
  float sum = 0;
  for (const std::uint32_t i : emitters_.environments())
    sum += emitters_.environment(i).pdf_direct_solid_angle(front, d) * prob(reference.p, front, i, technique);
  return sum;
}

// ---- the same with weights

template <class Pdf>
DirectOutcome Lights::sample_chosen(const EmitterChoice& choice, const SurfaceHit& reference, Vec3 front,
                                    Vec2 u, DirectSample& out, PointSampler point,
                                    const Pdf& pdf_environment) const {
  out.emitter = choice.emitter;
  const DirectOutcome outcome =
      emitters_.sample_direct_by(point, choice.emitter, reference, front, choice.rest, u, out);
  if (outcome == DirectOutcome::failed) return outcome;
  out.pdf_solid_angle *= choice.prob;
  if (emitters_.environments().size() > 1 && emitters_.is_environment(choice.emitter)) {
    out.pdf_solid_angle = pdf_environment(out.wi);
    out.radiance = faces(front, out.wi) ? environment(out.wi) : Spectrum();
    return out.radiance.is_black() ? DirectOutcome::dark : DirectOutcome::sampled;
  }
  return outcome;
}

DirectOutcome Lights::sample(const SurfaceHit& reference, Vec3 front, float u_select, Vec2 u,
                             DirectSample& out, Weights weights, PointSampler point) const {
  EmitterChoice choice;
  if (!choose(reference.p, front, extend_draw(u_select, u.x, u.y), weights, choice))
    return DirectOutcome::failed;
  return sample_chosen(choice, reference, front, u, out, point,
                       [&](Vec3 d) { return pdf_environment_solid_angle(reference, front, d, weights); });
}

float Lights::pdf_environment_solid_angle(const SurfaceHit& reference, Vec3 front, Vec3 d,
                                          Weights weights) const {
  float sum = 0;
  for (const std::uint32_t i : emitters_.environments())
    sum += emitters_.environment(i).pdf_direct_solid_angle(front, d) * prob(reference.p, front, i, weights);
  return sum;
}

// ---- the same in a group

template <class F>
decltype(auto) Lights::with_chooser(LightTechnique technique, const LightGroup& among, const F& f) const {
  struct Adaptive {
    const Lights& lights;
    ChoiceWeights weights;
    bool choose(Vec3 p, Vec3 front, double u, EmitterChoice& out) const {
      return lights.choose(p, front, u, weights, out);
    }
    float prob(Vec3 p, Vec3 front, std::uint32_t emitter) const {
      return lights.prob(p, front, emitter, weights);
    }
  };
  if (technique == LightTechnique::uniform) return f(among.uniform);
  if (technique == LightTechnique::power) return f(among.by_power);
  return f(Adaptive{*this, {among.members, among.node_weights}});
}

DirectOutcome Lights::sample(const SurfaceHit& reference, Vec3 front, float u_select, Vec2 u,
                             DirectSample& out, LightTechnique technique, const LightGroup& among,
                             PointSampler point) const {
  EmitterChoice choice;
  const double u_choice = extend_draw(u_select, u.x, u.y);
  if (!with_chooser(technique, among, [&](const auto& chooser) {
        return chooser.choose(reference.p, front, u_choice, choice);
      }))
    return DirectOutcome::failed;
  return sample_chosen(choice, reference, front, u, out, point, [&](Vec3 d) {
    return pdf_environment_solid_angle(reference, front, d, technique, among);
  });
}

float Lights::prob(Vec3 p, Vec3 front, std::uint32_t emitter, LightTechnique technique,
                   const LightGroup& among) const {
  return with_chooser(technique, among, [&](const auto& chooser) { return chooser.prob(p, front, emitter); });
}

float Lights::pdf_environment_solid_angle(const SurfaceHit& reference, Vec3 front, Vec3 d,
                                          LightTechnique technique, const LightGroup& among) const {
  float sum = 0;
  for (const std::uint32_t i : emitters_.environments())
    sum += emitters_.environment(i).pdf_direct_solid_angle(front, d) *
           prob(reference.p, front, i, technique, among);
  return sum;
}

// ---- light as it leaves

float Lights::prob_emission_environments() const {
  float sum = 0;
  for (const std::uint32_t i : emitters_.environments()) sum += prob_emission(i);
  return sum;
}

bool Lights::pdf_emission_environment(Vec3 to_light, EmissionDensity& out) const {
  out = {};
  double joint = 0;
  for (const std::uint32_t i : emitters_.environments()) {
    joint += static_cast<double>(prob_emission(i)) *
             static_cast<double>(emitters_.environment(i).pdf_solid_angle(to_light));
  }
  if (!(joint > 0)) return false;
  out.prob = prob_emission_environments();
  out.pdf_solid_angle = static_cast<float>(joint / static_cast<double>(out.prob));
  out.pdf_area = extent_.pdf_disk_area();
  out.cosine = 1;
  out.infinite = true;
  return true;
}

bool Lights::pdf_emission(const SurfaceHit& hit, Vec3 d, EmissionDensity& out) const {
  out = {};
  if (hit.emitter == kNone) return false;
  out.prob = prob_emission(hit.emitter);
  return emitters_.pdf_emission(hit.emitter, extent_, hit.p, hit.ng, d, out);
}

bool Lights::pdf_emission(const DirectSample& light, EmissionDensity& out) const {
  if (emitters_.is_environment(light.emitter)) return pdf_emission_environment(light.wi, out);
  out = {};
  out.prob = prob_emission(light.emitter);
  return emitters_.pdf_emission(light.emitter, extent_, light.p, light.ng, -light.wi, out);
}

bool Lights::sample_emission(float u_select, Vec2 u_position, Vec2 u_direction, EmissionSample& out) const {
  EmitterChoice choice;
  if (emitters_.empty() || !by_power_.choose(extend_draw(u_select, u_position.x, u_position.y), choice))
    return false;
  static_cast<EmissionDensity&>(out) = {};
  out.prob = choice.prob;
  out.vertex = {};
  out.vertex.emitter = choice.emitter;
  out.cosine = 1;
  if (!(out.prob > 0)) return false;
  if (!emitters_.sample_emission(choice.emitter, extent_, choice.rest, u_position, u_direction, out))
    return false;
  if (emitters_.environments().size() > 1 && emitters_.is_environment(choice.emitter)) {
    // Light of all environments comes along this ray, whichever of them proposed it.
    const Vec3 to_light = -out.ray.direction;
    out.radiance = environment(to_light);
    if (!pdf_emission_environment(to_light, out)) return false;
  }
  if (!(out.pdf_solid_angle > 0)) return false;
  // In double: an area of 1e-30 and a probability of 1e-9 leave the range of floats.
  const double density = static_cast<double>(out.prob) * static_cast<double>(out.pdf_area) *
                         static_cast<double>(out.pdf_solid_angle);
  const double factor = static_cast<double>(out.cosine) / density;
  out.weight = {static_cast<float>(static_cast<double>(out.radiance.r) * factor),
                static_cast<float>(static_cast<double>(out.radiance.g) * factor),
                static_cast<float>(static_cast<double>(out.radiance.b) * factor)};
  // Light too strong for a float starts all the same: it is rejected and counted, not lost silently.
  return out.weight.max_component() > 0;
}

}  // namespace candela::scene
