// The lights of a scene: its emitters, the choosers among them, and the sampling of light by both.
//
// Seen from a point, one emitter is chosen (choice/) and then a direction to it (emitters/<kind>). With few
// emitters the choice is by importance, beyond ImportanceChooser::kMaxEmitters by a light tree. Light paths
// have no reference: for them emitters are chosen by power, positions uniformly in area, directions in
// proportion to the cosine (surfaces), uniformly (points, cones of spots) or to the environment's radiance;
// light from outside starts on a disk across its direction that covers the scene's bounding sphere
// [Veach 1997, Sec. 4.6 and 8.3].
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "worker/scene/emitters/choice/importance.h"
#include "worker/scene/emitters/choice/power.h"
#include "worker/scene/emitters/choice/tree.h"
#include "worker/scene/emitters/choice/uniform.h"
#include "worker/scene/emitters/emitter.h"
#include "worker/scene/emitters/emitter_set.h"

namespace candela::scene {

struct LightGroup;  // light_groups.h

// The choice of the emitter in direct light. With a sampler of points it makes a technique.
enum class LightTechnique : std::uint8_t {
  adapted,  // to the reference: by importance or tree; the technique of Scene::sample_direct
  power,
  uniform,
};
inline constexpr LightTechnique kLightTechniques[] = {LightTechnique::adapted, LightTechnique::power,
                                                      LightTechnique::uniform};

class Lights {
 public:
  // The geometry must outlive this. Emitters are numbered in the order of adding.
  explicit Lights(const Geometry& geometry) : geometry_(&geometry) {}
  Lights(const Lights&) = delete;
  Lights& operator=(const Lights&) = delete;

  // See make_area_light.
  std::uint32_t add_area(std::uint32_t shape, const Rectangle* rectangle, const ColorTexture& radiance) {
    return add(make_area_light(*geometry_, shape, rectangle, radiance));
  }
  std::uint32_t add(Emitter emitter) { return emitters_.add(std::move(emitter)); }
  // The edits in `bits` turn the light of an emitter, which is not infinite. Before finish().
  void edit(std::uint32_t emitter, const SceneEdits& edits, std::uint16_t bits);
  // After the last add: distances and powers need the scene's extent.
  void finish();

  std::size_t size() const { return emitters_.size(); }
  bool infinite(std::uint32_t emitter) const { return emitters_.infinite(emitter); }
  bool is_environment(std::uint32_t emitter) const { return emitters_.is_environment(emitter); }

  // Radiance of area emitter hit.emitter from its surface at `hit` towards wo.
  Spectrum emitted(const SurfaceHit& hit, Vec3 wo) const { return emitters_.emitted(hit, wo); }
  Spectrum environment(Vec3 d) const;
  // Its parts: the environments by index, and what one of them brings.
  const std::vector<std::uint32_t>& environments() const { return emitters_.environments(); }
  Spectrum environment(std::uint32_t emitter, Vec3 d) const {
    return emitters_.environment(emitter).radiance(d);
  }

  // See Scene. The densities of all techniques at one direction may be combined: a direction that one
  // technique samples or finds dark has the density that the others say here.
  DirectOutcome sample(const SurfaceHit& reference, Vec3 front, float u_select, Vec2 u, DirectSample& out,
                       LightTechnique technique = LightTechnique::adapted,
                       PointSampler point = PointSampler::own) const;
  float pdf_solid_angle(const SurfaceHit& reference, Vec3 front, Vec3 d, const SurfaceHit& hit,
                        LightTechnique technique = LightTechnique::adapted) const;
  float pdf_environment_solid_angle(const SurfaceHit& reference, Vec3 front, Vec3 d,
                                    LightTechnique technique = LightTechnique::adapted) const;
  // The density of the direction d to `hit`, given that its emitter was chosen. Reads emitter, p, ng and
  // primitive of the hit.
  float pdf_point_solid_angle(const SurfaceHit& reference, Vec3 front, Vec3 d, const SurfaceHit& hit,
                              PointSampler point) const {
    return emitters_.pdf_direct_by_solid_angle(point, hit.emitter, reference.p, front, d, hit);
  }
  // The discrete probability of choosing `emitter` at the reference; what sample() uses.
  float prob(Vec3 reference, Vec3 front, std::uint32_t emitter,
             LightTechnique technique = LightTechnique::adapted) const;

  // Light from this emitter, whose choice is left out of all densities. Of an emitter that is met by no ray
  // (point, spot, directional) there is but one sample.
  DirectOutcome sample_emitter(std::uint32_t emitter, const SurfaceHit& reference, Vec3 front,
                               DirectSample& out) const {
    out = {};
    out.emitter = emitter;
    return emitters_.sample_direct(emitter, reference, front, 0.5, {0.5f, 0.5f}, out);
  }

  // As above, by the technique `adapted`, its probabilities times weights of groups of emitters.
  // Precondition: at least 2 emitters.
  using Weights = const ChoiceWeights&;
  DirectOutcome sample(const SurfaceHit& reference, Vec3 front, float u_select, Vec2 u, DirectSample& out,
                       Weights weights, PointSampler point) const;
  float pdf_environment_solid_angle(const SurfaceHit& reference, Vec3 front, Vec3 d, Weights weights) const;
  float prob(Vec3 reference, Vec3 front, std::uint32_t emitter, Weights weights) const {
    return adapted_ == Adapted::tree ? by_tree_.prob(reference, front, emitter, weights)
                                     : by_importance_.prob(reference, front, emitter, weights);
  }
  static constexpr std::size_t kMaxGroups = TreeChooser::kMaxGroups;
  static_assert(kMaxGroups == ImportanceChooser::kMaxEmitters);
  std::uint32_t group(std::uint32_t emitter) const {
    return adapted_ == Adapted::tree ? by_tree_.group(emitter) : emitter;
  }
  // Room for the weights of nodes, which follow from those of groups.
  using NodeWeights = std::array<float, TreeChooser::kMaxNodes>;
  ChoiceWeights weights(std::span<const std::uint8_t> of_groups, NodeWeights& room) const {
    if (adapted_ != Adapted::tree) return {of_groups};
    return {of_groups, by_tree_.node_weights(of_groups, room)};
  }
  // The same by any technique among the emitters of a group. Precondition: at least 2 emitters. The densities
  // are those of emitters of the group; the environments are in the group if
  // pdf_environment_solid_angle is called.
  DirectOutcome sample(const SurfaceHit& reference, Vec3 front, float u_select, Vec2 u, DirectSample& out,
                       LightTechnique technique, const LightGroup& among, PointSampler point) const;
  float pdf_environment_solid_angle(const SurfaceHit& reference, Vec3 front, Vec3 d, LightTechnique technique,
                                    const LightGroup& among) const;
  float prob(Vec3 reference, Vec3 front, std::uint32_t emitter, LightTechnique technique,
             const LightGroup& among) const;
  // W, luminance, as the technique `power` weighs the emitter.
  double weight_of_power(std::uint32_t emitter) const { return emitters_.weight_of_power(emitter, extent_); }
  // Around everything that has a place.
  const SceneExtent& extent() const { return extent_; }

  bool sample_emission(float u_select, Vec2 u_position, Vec2 u_direction, EmissionSample& out) const;
  bool pdf_emission(const SurfaceHit& hit, Vec3 d, EmissionDensity& out) const;
  bool pdf_emission(const DirectSample& light, EmissionDensity& out) const;
  bool pdf_emission_environment(Vec3 to_light, EmissionDensity& out) const;
  // Power in W, towards the scene (light from outside: onto its bounding sphere); analytic where radiance
  // does not vary, by a fixed quadrature otherwise.
  Spectrum power(std::uint32_t emitter) const { return emitters_.power(emitter, extent_); }
  // The discrete probability with which sample_emission chooses the emitter.
  float prob_emission(std::uint32_t emitter) const { return by_power_.prob(emitter); }

 private:
  // Calls f(chooser) with that of the technique.
  template <class F>
  decltype(auto) with_chooser(LightTechnique technique, const F& f) const;
  // Chooses the emitter of sample(). False: none can light the point.
  bool choose(Vec3 p, Vec3 front, double u, LightTechnique technique, EmitterChoice& out) const;
  bool choose(Vec3 p, Vec3 front, double u, Weights weights, EmitterChoice& out) const {
    return adapted_ == Adapted::tree ? by_tree_.choose(p, front, u, weights, out)
                                     : by_importance_.choose(p, front, u, weights, out);
  }
  // Calls f(chooser) with that of the technique among the emitters of a group.
  template <class F>
  decltype(auto) with_chooser(LightTechnique technique, const LightGroup& among, const F& f) const;
  // A point on the emitter that was chosen. pdf_environment(d): of a direction out of the scene.
  template <class Pdf>
  DirectOutcome sample_chosen(const EmitterChoice& choice, const SurfaceHit& reference, Vec3 front, Vec2 u,
                              DirectSample& out, PointSampler point, const Pdf& pdf_environment) const;
  // Probability of choosing any environment for a light path.
  float prob_emission_environments() const;

  const Geometry* geometry_;
  EmitterSet emitters_;
  SceneExtent extent_;
  // The way in which the adapted technique chooses.
  enum class Adapted : std::uint8_t { importance, tree } adapted_ = Adapted::importance;
  bool draws_choice_ = false;  // sample() reads its first number
  ImportanceChooser by_importance_{emitters_};
  TreeChooser by_tree_;
  PowerChooser by_power_;
  UniformChooser uniform_;
};

}  // namespace candela::scene
