// Path-space regularization as integrators have it: the settings, what a scene needs of it, and the bandwidth
// of each sample (transport/regularise.h).
#pragma once

#include <cstdint>

#include "worker/integrators/plan.h"
#include "worker/integrators/plan_light.h"
#include "worker/integrators/settings.h"
#include "worker/scene/features.h"
#include "worker/transport/regularise.h"

namespace candela::integrators {

struct RegulariseSettings {
  Choice regularise{"off", {"off", "on"}};
  double radius = 0.01;
  double exponent = 1.0 / 6;
  bool layer = false;

  bool on() const { return regularise.value == "on"; }
  Mollifies mollifies() const { return on() ? Mollifies::always : Mollifies::if_asked; }

  template <class Visitor>
  void fields(Visitor& visit) {
    visit("regularise", regularise,
          "on: show light that no technique of this integrator can sample, blurred; off: leave it out");
    visit("regularise_radius", radius, NumberRange{0, 1, true},
          "first radius of the blur, as a fraction of the radius of the scene's bounding sphere");
    visit("regularise_exponent", exponent, NumberRange{0, 0.5, false, true},
          "the radius falls as n^-exponent over the job; 0: the radius and the bias stay");
    visit("regularise_layer", layer,
          "further layer in the EXR, `mollified`: the light that regularise=on shows");
  }
};

// The layer of mollified light.
inline constexpr const char* kMollifiedLayer = "mollified";

// Tells if it runs in a scene, and its bandwidths. Bandwidths are a function of the settings, the scene and
// the sample's index in the job.
class Regularization {
 public:
  Regularization() = default;
  Regularization(double first, double exponent, bool layer = false)
      : runs_(true), layer_(layer), first_(first), exponent_(exponent) {}

  bool runs() const { return runs_; }
  bool layer() const { return layer_; }  // asked for
  double first() const { return first_; }
  double bandwidth(std::uint64_t iteration) const {
    return transport::bandwidth(first_, iteration, exponent_);
  }

 private:
  bool runs_ = false, layer_ = false;
  double first_ = 1, exponent_ = 0;
};

// Bandwidths of chains: of each segment one, so that a segment is a function of its number and its start, and
// detailed balance holds in it. Epochs are of kEpochMutations mutations of a chain; a segment belongs to the
// epoch that it begins in. [regularisation note, section 8]
class ChainRegularization {
 public:
  static constexpr std::uint64_t kEpochMutations = 10000;

  ChainRegularization() = default;
  ChainRegularization(const Regularization& regularization, bool geometric)
      : regularization_(regularization), geometric_(geometric) {}

  bool runs() const { return regularization_.runs(); }
  bool layer() const { return regularization_.layer(); }
  // Bandwidth of a segment whose first mutation this is. The bootstrap has that of mutation 0.
  double bandwidth(std::uint64_t mutation) const;

 private:
  Regularization regularization_;
  bool geometric_ = false;
};

// Decides, and says so in the plan. Says nothing if the settings have it off.
Regularization plan_regularization(const RegulariseSettings& settings, const scene::SceneFeatures& features,
                                   std::uint32_t max_depth, transport::Connecting techniques, Plan& plan);

// Fails (usage) if the job has layers by light path expressions: mollified paths have no letters.
Result<void> check(const Regularization& regularization, const scene::SceneFeatures& features);

}  // namespace candela::integrators
