// Direct light at the first vertex of a path that is not specular, by several techniques at once: what the
// path tracer (path.h) does there in place of its two, with weights by any heuristic, and the controls of
// optimal multiple importance sampling (common/mis/sums.h).
//
// A batch is one draw of every technique: of the bsdf, and of a point on a light by each way of choosing the
// light. c_i is the density of technique i over the sum of all at the point that was drawn.
//   dark      no light arrives: c from the densities of the light techniques
//   failed    no point was drawn; a bsdf ray that meets no light
//   occluded  as dark. The bsdf technique's density is that of finding light: it is zero at a point that is
//             occluded or black, and its rays that find none are failures. Any other convention must be kept
//             for both, or the controls have not the expectation 1
// If light may pass surfaces straight or cross media, chance decides whether a bsdf ray arrives, and its
// density is not known. Then the bsdf technique is a control of its own that never varies, and the controls
// of the light techniques are shares among these. The weights of contributions are what they are in the path
// tracer.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "common/mis/sums.h"
#include "worker/estimators/options.h"
#include "worker/scene/emitters/lights.h"
#include "worker/scene/scene.h"

namespace candela::estimators {

struct FirstVertexSetup {
  bool bsdf = false;                              // technique 0, if it is there
  std::vector<scene::LightTechnique> selections;  // the techniques after it
  mis::Heuristic heuristic = mis::Heuristic::balance;
  bool controls = false;       // tallied; the heuristic is the balance heuristic's
  bool bsdf_is_alone = false;  // see above
  bool direct_only = false;    // the path ends there

  std::size_t techniques() const { return selections.size() + (bsdf ? 1 : 0); }
};

// The path tracer's own techniques at every vertex.
struct NoFirstVertex {
  static constexpr bool kActive = false;
};

// For one path at a time.
class FirstVertex {
 public:
  static constexpr bool kActive = true;

  FirstVertex(const FirstVertexSetup& setup, const PathOptions& options)
      : setup_(setup), options_(options), all_options_(options), n_(setup.techniques()) {
    allocation_ = mis::Allocation::ones(n_);
  }
  // The limits of the path, which ends early where direct light is all that is asked for.
  const PathOptions& options() const { return options_; }

  void start() {
    options_ = all_options_;
    batch_ = {};
    reached_ = pending_ = false;
  }
  // The path is there, and draws every technique.
  void reach() {
    reached_ = true;
    pending_ = setup_.bsdf;
    light_ = {};
    controls_ = setup_.bsdf ? mis::controls_of_one(allocation_, 0) : mis::Vector{};
  }
  // The path goes on from there; `depth` edges from the eye is what its ray meets.
  void leave(std::uint32_t depth) {
    if (setup_.direct_only) options_.max_depth = depth;
  }

  const std::vector<scene::LightTechnique>& selections() const { return setup_.selections; }

  void failed(std::size_t selection) {
    if (setup_.controls) batch_.add(n_, mis::controls_of_one(allocation_, technique(selection)), {});
  }

  // Light from a point that the technique drew, or none. `light`: of that technique. value: what arrives,
  // before it is divided by a density. Returns the contribution.
  Spectrum drawn(const scene::Scene& scene, const scene::SurfaceHit& here, Vec3 front, std::size_t selection,
                 const scene::DirectSample& light, float pdf_bsdf, const Spectrum& value) {
    std::array<double, mis::kMaxTechniques> p{};
    const scene::Lights& lights = scene.lights();
    const bool environment = light.infinite && !light.delta;
    const float chosen =
        environment ? 1 : lights.prob(here.p, front, light.emitter, setup_.selections[selection]);
    for (std::size_t i = 0; i < setup_.selections.size(); ++i) {
      double& to = p[technique(i)];
      if (i == selection)
        to = light.pdf_solid_angle;
      else if (environment)
        to = lights.pdf_environment_solid_angle(here, front, light.wi, setup_.selections[i]);
      else
        to = static_cast<double>(light.pdf_solid_angle) / static_cast<double>(chosen) *
             static_cast<double>(lights.prob(here.p, front, light.emitter, setup_.selections[i]));
    }
    if (setup_.bsdf) p[0] = pdf_bsdf;
    const std::size_t own = technique(selection);
    if (!usable(p, own)) {
      failed(selection);
      return {};
    }
    mis::Vector weights{};
    mis::weights(setup_.heuristic, allocation_, p, weights);
    const Spectrum contribution =
        value.is_black() ? Spectrum() : value * static_cast<float>(weights[own] / p[own]);
    if (setup_.controls) {
      if (setup_.bsdf_is_alone && setup_.bsdf) p[0] = 0;
      batch_.add(n_, mis::controls(allocation_, p).c, color(contribution));
    }
    return contribution;
  }

  // Light that the bsdf's ray found: `value` is divided by the density with which it was drawn. pdf_light(t):
  // the density of a light technique. Returns the contribution.
  template <class PdfLight>
  Spectrum found(float pdf_bsdf, bool delta, const Spectrum& value, const PdfLight& pdf_light) {
    if (delta) {  // nobody else can find it
      if (setup_.bsdf) add_light(value);
      return value;
    }
    if (!setup_.bsdf) return {};
    std::array<double, mis::kMaxTechniques> p{};
    p[0] = pdf_bsdf;
    for (std::size_t i = 0; i < setup_.selections.size(); ++i)
      p[technique(i)] = pdf_light(setup_.selections[i]);
    if (!usable(p, 0)) return {};
    mis::Vector weights{};
    mis::weights(setup_.heuristic, allocation_, p, weights);
    const Spectrum contribution = value * static_cast<float>(weights[0]);
    if (!setup_.bsdf_is_alone) controls_ = mis::controls(allocation_, p).c;
    add_light(contribution);
    return contribution;
  }

  // The path has ended. Whether there was such a vertex, and the sums of its batch.
  bool finish() {
    if (pending_ && setup_.controls) batch_.add(n_, controls_, light_);
    pending_ = false;
    return reached_;
  }
  const mis::Sums& batch() const { return batch_; }

 private:
  std::size_t technique(std::size_t selection) const { return selection + (setup_.bsdf ? 1 : 0); }
  bool usable(const std::array<double, mis::kMaxTechniques>& p, std::size_t own) const {
    double sum = 0;
    for (std::size_t i = 0; i < n_; ++i) sum += p[i];
    return p[own] > 0 && std::isfinite(sum);
  }
  static mis::Color color(const Spectrum& s) {
    return {static_cast<double>(s.r), static_cast<double>(s.g), static_cast<double>(s.b)};
  }
  void add_light(const Spectrum& s) {
    const mis::Color more = color(s);
    for (std::size_t k = 0; k < mis::kColors; ++k) light_[k] += more[k];
  }

  const FirstVertexSetup& setup_;
  PathOptions options_;
  const PathOptions all_options_;
  const std::size_t n_;
  mis::Allocation allocation_;
  mis::Sums batch_;
  bool reached_ = false;
  // The bsdf's draw: its controls and light are complete when the path has ended.
  bool pending_ = false;
  mis::Vector controls_{};
  mis::Color light_{};
};

}  // namespace candela::estimators
