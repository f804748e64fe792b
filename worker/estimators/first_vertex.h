// Direct light at the first vertex of a path that is not specular, by several techniques at once: what the
// path tracer (path.h) does there in place of its two, with weights by any heuristic, and the controls of
// optimal multiple importance sampling (common/mis/sums.h).
//
// A batch is one draw of every technique: of the bsdf, and of a point on a light by each way of choosing the
// light with each way of sampling a point on it. c_i is the density of technique i over the sum of all at the
// point that was drawn.
//   dark      no light arrives: c from the densities of the light techniques
//   failed    no point was drawn; a bsdf ray that meets no light
//   occluded  as dark. The bsdf technique's density is that of finding light: it is zero at a point that is
//             occluded or black, and its rays that find none are failures. Any other convention must be kept
//             for both, or the controls have not the expectation 1
// If light may pass surfaces straight or cross media, chance decides whether a bsdf ray arrives, and its
// density is not known. Then the bsdf technique is a control of its own that never varies, and the controls
// of the light techniques are shares among these. The weights of contributions are what they are in the path
// tracer.
//
// Groups of lights (scene/emitters/light_groups.h), if there are several, have a batch each: every light
// technique draws a point on a light of each group, and the bsdf's ray is a failure for all groups but that
// of the light which it meets.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/mis/batch.h"
#include "worker/estimators/light_weights.h"
#include "worker/estimators/options.h"
#include "worker/scene/emitters/light_groups.h"
#include "worker/scene/emitters/lights.h"
#include "worker/scene/scene.h"

namespace candela::estimators {

inline constexpr std::size_t kMaxLightGroups = 8;

struct FirstVertexSetup {
  bool bsdf = false;  // technique 0, if it is there
  // The techniques after it: all points by the first selection, then all by the second, ...
  std::vector<scene::LightTechnique> selections;
  std::vector<scene::PointSampler> points = {scene::PointSampler::own};
  // The selection that has weights (light_weights.h), if any.
  static constexpr std::size_t kNone = ~std::size_t{0};
  std::size_t trained = kNone;
  scene::LightPartition partition = scene::LightPartition::one;
  std::size_t groups = 1;  // of the partition, of this scene; at most kMaxLightGroups
  mis::Heuristic heuristic = mis::Heuristic::balance;
  bool controls = false;       // tallied; the heuristic is the balance heuristic's
  bool bsdf_is_alone = false;  // see above
  bool direct_only = false;    // the path ends there

  // For each group of lights.
  std::size_t light_techniques() const { return selections.size() * points.size(); }
  std::size_t techniques() const { return light_techniques() + (bsdf ? 1 : 0); }
};

// The path tracer's own techniques at every vertex.
struct NoFirstVertex {
  static constexpr bool kActive = false;
};

// For one path at a time.
class FirstVertex {
 public:
  static constexpr bool kActive = true;

  // lights: of the trained selection; null: it is the choice adapted to the point.
  // groups: of lights, as many as the setup says; null: all lights are one.
  FirstVertex(const FirstVertexSetup& setup, const PathOptions& options, const LightWeights* lights = nullptr,
              const scene::LightGroups* groups = nullptr)
      : setup_(setup),
        groups_(groups),
        trained_(lights != nullptr ? setup.trained : FirstVertexSetup::kNone),
        lights_(lights),
        options_(options),
        all_options_(options),
        n_(setup.techniques()) {
    allocation_ = mis::Allocation::ones(n_);
    bsdf_fails_ = mis::controls_of_one(allocation_, 0);
    const std::size_t techniques = setup.light_techniques(), points = setup.points.size();
    for (std::size_t i = 0; i < light_draws(); ++i) {
      const std::size_t t = i % techniques;
      draws_[i] = {i / techniques, technique(t), sample(technique(t)), t / points, t % points};
    }
  }
  // The limits of the path, which ends early where direct light is all that is asked for.
  const PathOptions& options() const { return options_; }

  void start() {
    options_ = all_options_;
    reached_ = false;
    tests_ = 0;
  }
  // The path is there, and draws every technique.
  void reach(const scene::Lights& lights, Vec3 p) {
    reached_ = true;
    if (lights_ != nullptr) [[unlikely]]
      enter_cell(lights, p);
    if (setup_.controls) clear_batches();
  }
  // The path goes on from there; `depth` edges from the eye is what its ray meets.
  void leave(std::uint32_t depth) {
    if (setup_.direct_only) options_.max_depth = depth;
  }

  // Every light technique for the first group of lights, then for the next.
  std::size_t light_draws() const { return setup_.groups * setup_.light_techniques(); }
  scene::DirectOutcome sample(const scene::Lights& lights, const scene::SurfaceHit& here, Vec3 front,
                              float u_select, Vec2 u, std::size_t light_draw,
                              scene::DirectSample& out) const {
    const Draw& draw = draws_[light_draw];
    const std::size_t s = draw.selection;
    const scene::PointSampler point = setup_.points[draw.point];
    if (s == trained_) return lights.sample(here, front, u_select, u, out, weights_, point);
    if (groups_ != nullptr) [[unlikely]]
      return lights.sample(here, front, u_select, u, out, setup_.selections[s], (*groups_)[draw.group],
                           point);
    return lights.sample(here, front, u_select, u, out, setup_.selections[s], point);
  }
  // A point on an emitter was looked for.
  void tested(const scene::Lights& lights, std::uint32_t emitter, bool seen) {
    if (lights_ != nullptr) [[unlikely]]
      count(lights.group(emitter), seen);
  }
  struct ShadowTest {
    std::uint32_t entry;  // of the light weights
    bool seen;
  };
  std::span<const ShadowTest> shadow_tests() const { return std::span(shadow_tests_).first(tests_); }

  void failed(std::size_t light_draw) {
    const Draw& draw = draws_[light_draw];
    if (setup_.controls) set(draw, mis::controls_of_one(allocation_, draw.technique), {});
  }

  // Light from a point that a light technique drew, or none. `light`: of that draw. value: what arrives,
  // before it is divided by a density. Returns the contribution.
  Spectrum drawn(const scene::Scene& scene, const scene::SurfaceHit& here, Vec3 front, std::size_t light_draw,
                 const scene::DirectSample& light, float pdf_bsdf, const Spectrum& value) {
    const Draw& draw = draws_[light_draw];
    Densities p{};
    if (light.infinite && !light.delta)
      add_environment_densities(scene.lights(), here, front, light.wi, draw.group, p);
    else
      add_densities(scene.lights(), here, front, draw, light, p);
    const std::size_t own = draw.technique;
    p[own] = static_cast<double>(light.pdf_solid_angle);
    if (setup_.bsdf) p[0] = static_cast<double>(pdf_bsdf);
    if (!usable(p, own)) {
      failed(light_draw);
      return {};
    }
    const mis::Vector weights = weights_at(p);
    const Spectrum contribution =
        value.is_black() ? Spectrum() : value * static_cast<float>(weights[own] / p[own]);
    if (setup_.controls) {
      if (setup_.bsdf && setup_.bsdf_is_alone) p[0] = 0;
      set(draw, setup_.bsdf_is_alone ? mis::control_vector(allocation_, p) : weights, color(contribution));
      batches_[draw.group].lit |= !value.is_black();
    }
    return contribution;
  }

  // Light that the bsdf's ray from `here` along d found, on a surface or (hit: null) outside of the scene.
  // `value` is divided by the density with which the ray was drawn. Returns the contribution.
  Spectrum found(const scene::Lights& lights, const scene::SurfaceHit& here, Vec3 front, Vec3 d,
                 const scene::SurfaceHit* hit, float pdf_bsdf, bool delta, const Spectrum& value) {
    std::size_t group = 0;
    if (groups_ != nullptr) [[unlikely]]
      group = hit == nullptr ? groups_->of_environment() : groups_->of(hit->emitter);
    if (delta) {  // nobody else can find it
      add_light(group, value);
      return value;
    }
    if (!setup_.bsdf) return {};
    Densities p{};
    p[0] = static_cast<double>(pdf_bsdf);
    if (hit == nullptr)
      add_environment_densities(lights, here, front, d, group, p);
    else
      add_densities(lights, here, front, d, *hit, group, p);
    if (!usable(p, 0)) return {};
    const mis::Vector weights = weights_at(p);
    if (setup_.controls && !setup_.bsdf_is_alone) batches_[group].samples[n_ - 1].c = weights;
    const Spectrum contribution = value * static_cast<float>(weights[0]);
    add_light(group, contribution);
    return contribution;
  }

  // When the path has ended: whether there was such a vertex, and then its batch, of a group of lights.
  bool reached() const { return reached_; }
  const mis::Batch& batch(std::size_t group = 0) const { return batches_[group]; }

 private:
  using Densities = mis::Vector;
  // A point on a light: the group of lights, the technique, its sample in the batch, and its parts by index
  // in the setup.
  struct Draw {
    std::size_t group, technique, sample, selection, point;
  };

  // For trained selection alone; not inlined, so that the path without it costs no more.
  [[gnu::noinline]] void enter_cell(const scene::Lights& lights, Vec3 p) {
    const std::uint32_t cell = lights_->cell(p);
    if (cell != cell_) weights_ = lights.weights(lights_->of_cell(cell), node_weights_);
    cell_ = cell;
  }
  [[gnu::noinline]] void count(std::uint32_t group, bool seen) {
    shadow_tests_[tests_++] = {lights_->entry(cell_, group), seen};
  }

  // By the heuristic. Those of the balance heuristic are the controls, since each technique has one sample.
  mis::Vector weights_at(const Densities& p) const {
    if (setup_.heuristic == mis::Heuristic::balance) return mis::control_vector(allocation_, p);
    mis::Vector weights{};
    mis::weights(setup_.heuristic, allocation_, p, weights);
    return weights;
  }
  std::size_t technique(std::size_t light_technique) const { return light_technique + (setup_.bsdf ? 1 : 0); }
  // In the batch: the bsdf's sample is the last.
  std::size_t sample(std::size_t technique) const {
    return !setup_.bsdf ? technique : technique == 0 ? n_ - 1 : technique - 1;
  }
  void set(const Draw& draw, const mis::Vector& c, const mis::Color& f_over_q) {
    batches_[draw.group].samples[draw.sample] = {c, f_over_q};
  }
  // Batches without light, in which the bsdf technique has failed. The light techniques set all of theirs.
  void clear_batches() {
    for (std::size_t g = 0; g < setup_.groups; ++g) {
      mis::Batch& batch = batches_[g];
      batch.lit = false;
      if (!setup_.bsdf) continue;
      batch.samples[n_ - 1] = {bsdf_fails_, {}};
    }
  }
  float prob(const scene::Lights& lights, const scene::SurfaceHit& here, Vec3 front, std::uint32_t emitter,
             std::size_t group, std::size_t s) const {
    if (s == trained_) return lights.prob(here.p, front, emitter, weights_);
    if (groups_ != nullptr) [[unlikely]]
      return lights.prob(here.p, front, emitter, setup_.selections[s], (*groups_)[group]);
    return lights.prob(here.p, front, emitter, setup_.selections[s]);
  }
  // The densities of the light techniques for a direction out of the scene; where an environment is chosen,
  // all sample it in its own way.
  void add_environment_densities(const scene::Lights& lights, const scene::SurfaceHit& here, Vec3 front,
                                 Vec3 d, std::size_t group, Densities& p) const {
    for (std::size_t s = 0; s < setup_.selections.size(); ++s) {
      const scene::LightTechnique selection = setup_.selections[s];
      const float pdf = s == trained_ ? lights.pdf_environment_solid_angle(here, front, d, weights_)
                        : groups_ != nullptr
                            ? lights.pdf_environment_solid_angle(here, front, d, selection, (*groups_)[group])
                            : lights.pdf_environment_solid_angle(here, front, d, selection);
      for (std::size_t m = 0; m < setup_.points.size(); ++m)
        p[technique(s * setup_.points.size() + m)] = static_cast<double>(pdf);
    }
  }
  // The same for a point on a surface that a ray found.
  void add_densities(const scene::Lights& lights, const scene::SurfaceHit& here, Vec3 front, Vec3 d,
                     const scene::SurfaceHit& hit, std::size_t group, Densities& p) const {
    std::array<float, mis::kMaxTechniques> given{};  // the emitter, by sampler of points
    bool any = false;
    for (std::size_t m = 0; m < setup_.points.size(); ++m) {
      given[m] = lights.pdf_point_solid_angle(here, front, d, hit, setup_.points[m]);
      any |= given[m] > 0;
    }
    if (!any) return;
    for (std::size_t s = 0; s < setup_.selections.size(); ++s) {
      const float chosen = prob(lights, here, front, hit.emitter, group, s);
      for (std::size_t m = 0; m < setup_.points.size(); ++m)
        if (given[m] > 0) p[technique(s * setup_.points.size() + m)] = static_cast<double>(given[m] * chosen);
    }
  }
  // The same for a point that a technique drew, but of this technique.
  void add_densities(const scene::Lights& lights, const scene::SurfaceHit& here, Vec3 front, const Draw& draw,
                     const scene::DirectSample& light, Densities& p) const {
    if (setup_.light_techniques() == 1) return;
    const std::size_t points = setup_.points.size();
    const std::size_t own_point = draw.point;
    const float chosen = prob(lights, here, front, light.emitter, draw.group, draw.selection);
    Densities given{};  // the emitter, by sampler of points
    given[own_point] = static_cast<double>(light.pdf_solid_angle) / static_cast<double>(chosen);
    if (points > 1) {
      scene::SurfaceHit hit;
      hit.p = light.p;
      hit.ng = light.ng;
      hit.emitter = light.emitter;
      hit.primitive = light.primitive;
      for (std::size_t m = 0; m < points; ++m) {
        if (m == own_point) continue;
        // A point-like emitter has one point.
        given[m] = light.delta ? given[own_point]
                               : static_cast<double>(lights.pdf_point_solid_angle(here, front, light.wi, hit,
                                                                                  setup_.points[m]));
      }
    }
    for (std::size_t s = 0; s < setup_.selections.size(); ++s) {
      const float of_selection =
          s == draw.selection ? chosen : prob(lights, here, front, light.emitter, draw.group, s);
      for (std::size_t m = 0; m < points; ++m)
        p[technique(s * points + m)] = given[m] * static_cast<double>(of_selection);
    }
  }
  bool usable(const Densities& p, std::size_t own) const {
    double sum = 0;
    for (std::size_t i = 0; i < n_; ++i) sum += p[i];
    return p[own] > 0 && std::isfinite(sum);
  }
  static mis::Color color(const Spectrum& s) {
    return {static_cast<double>(s.r), static_cast<double>(s.g), static_cast<double>(s.b)};
  }
  // To the bsdf's sample.
  void add_light(std::size_t group, const Spectrum& s) {
    if (!setup_.bsdf || !setup_.controls) return;
    const mis::Color more = color(s);
    batches_[group].lit = true;
    mis::Color& light = batches_[group].samples[n_ - 1].f_over_q;
    for (std::size_t k = 0; k < mis::kColors; ++k) light[k] += more[k];
  }

  const FirstVertexSetup& setup_;
  const scene::LightGroups* const groups_;
  const std::size_t trained_;  // selection
  const LightWeights* const lights_;
  std::uint32_t cell_ = scene::kNone;
  scene::Lights::NodeWeights node_weights_{};
  scene::ChoiceWeights weights_;  // of the cell
  std::size_t tests_ = 0;
  std::array<ShadowTest, mis::kMaxTechniques> shadow_tests_{};
  PathOptions options_;
  const PathOptions all_options_;
  const std::size_t n_;
  mis::Allocation allocation_;
  mis::Vector bsdf_fails_;                                         // its controls
  std::array<Draw, kMaxLightGroups * mis::kMaxTechniques> draws_;  // the first light_draws() are set
  // By group of lights; the bsdf's sample is complete when the path has ended.
  std::array<mis::Batch, kMaxLightGroups> batches_;
  bool reached_ = false;
};

}  // namespace candela::estimators
