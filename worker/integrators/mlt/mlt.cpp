// Metropolis light transport in path space [Veach 1997, ch. 11]: the states of the chains are paths, and
// mutations change a part of a path.
// This file has the settings, the plan, and the space of paths that the chains walk over (mcmc/path_space.h).
#include <fmt/format.h>

#include <algorithm>
#include <string>

#include "worker/estimators/film_domain.h"
#include "worker/integrators/chains/chain_integrator.h"
#include "worker/integrators/makers.h"
#include "worker/integrators/mlt/settings.h"
#include "worker/integrators/plan_light.h"
#include "worker/mcmc/path_space.h"

namespace candela::integrators {
namespace {

// The longest path if there is no limit, in edges: a chain's state has to fit into its record.
constexpr std::uint32_t kLongest = 1000;

class MltIntegrator final : public ChainIntegrator {
 public:
  MltIntegrator(const MltSettings& settings, const scene::SceneFeatures& features,
                const ChainRegularization& regularization, const Plan& regularized)
      : ChainIntegrator(settings.chains, settings.common.path_options(), features,
                        settings.common.full_plan(), 2),
        shortest_(chain_options().min_edges),
        longest_(std::min(chain_options().max_depth, kLongest)) {
    for (const mcmc::MutatorPreset& preset : mcmc::mutator_presets())
      if (preset.name == settings.mutations.preset.value)
        for (const mcmc::MutatorEntry& entry : preset.mutations) shares_.push_back({&entry, entry.share});
    const bool own = shares_.empty();
    for (std::size_t i = 0; own && i < settings.mutations.shares.size(); ++i)
      if (settings.mutations.shares[i] > 0)
        shares_.push_back({&mcmc::mutators()[i], settings.mutations.shares[i]});
    for (const mcmc::MutatorShare& share : shares_)
      plan_.use(std::string(share.entry->name),
                fmt::format("share {:.3g}: {}", share.share, share.entry->doc));
    if (longest_ < shortest_) {
      plan_.skip("chains", "max_depth leaves nothing to them");
      return;
    }
    plan_.use("path lengths", fmt::format("from {} to {} edges", shortest_, longest_));
    if (chain_options().max_depth > kLongest)
      plan_.note("path lengths", fmt::format("light of paths of more than {} edges is missing", kLongest));
    note_lucky_light(features, longest_, Finds::connections, settings.regularise.mollifies(), plan_);
    regularization_ = regularization;
    plan_.append(regularized);
  }

 private:
  Result<void> check_scene(const scene::Scene& scene) const override {
    // The film of an irradiance meter lies over its surface, where the lens of a camera is.
    float weight = 1;
    const bool meter =
        scene.reads_lens() && !(scene.near_distance(scene.camera_ray(0.5f, 0.5f, {0.5f, 0.5f}, weight)) > 0);
    if (meter)
      return usage_error("mlt has no paths to an irradiance meter")
          .with_field("integrator")
          .with_mend("use path, bdpt, pssmlt or mmlt");
    return {};
  }

  std::unique_ptr<mcmc::StateSpace> make_space(const UnitContext& context,
                                               film::SampleCounts& /*sample_counts*/,
                                               double bandwidth) const override {
    const estimators::FilmDomain film(context.filter, context.width, context.height);
    return std::make_unique<mcmc::PathSpace>(
        mcmc::MutatorContext{context.scene, static_cast<double>(context.width),
                             static_cast<double>(context.height), film.border(), shortest_, longest_,
                             regularization_.runs() ? bandwidth : 0},
        shares_, context.letters);
  }

  std::uint32_t shortest_, longest_;
  std::vector<mcmc::MutatorShare> shares_;
};

}  // namespace

Result<void> check(const MutatorSettings& settings) {
  for (std::size_t i = 0; i < settings.shares.size(); ++i) {
    const mcmc::MutatorEntry& entry = mcmc::mutators()[i];
    if (settings.preset.value == MutatorSettings::kOwn || settings.shares[i] == entry.share) continue;
    return usage_error(fmt::format("preset = {} has shares of its own", settings.preset.value))
        .with_field(std::string(entry.name))
        .with_mend("leave out this share, or preset");
  }
  if (std::any_of(settings.shares.begin(), settings.shares.end(), [](double share) { return share > 0; }))
    return {};
  return usage_error("no mutation has a share")
      .with_field(std::string(mcmc::mutators().front().name))
      .with_mend("give it a share above 0");
}

Result<std::unique_ptr<Integrator>> make_mlt_integrator(const SettingsMap& settings,
                                                        const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const MltSettings parsed, parse_settings<MltSettings>(settings));
  CANDELA_TRY(check(parsed.chains));
  CANDELA_TRY(check(parsed));
  const auto refuse = [](std::string what, std::string_view field, std::string mend) {
    return usage_error(std::move(what)).with_field(std::string(field)).with_mend(std::move(mend));
  };
  if (features.any_heterogeneous_medium)
    return refuse("mlt needs the transmittance of each path, which grids of extinction have no formula for",
                  "integrator", "use bdpt, upbp, pssmlt or mmlt, or homogeneous media");
  if (!features.edits.empty())
    return refuse("mlt does not render edits: " + features.edits.front(), "integrator",
                  "use bdpt, pssmlt or mmlt, or leave out the edits");
  Plan regularized;
  CANDELA_ASSIGN(
      const ChainRegularization regularization,
      chain_regularization(parsed.regularise, parsed.chains, features, parsed.common.path_options().max_depth,
                           transport::Connecting::bidirectional, regularized));
  return std::unique_ptr<Integrator>(
      std::make_unique<MltIntegrator>(parsed, features, regularization, regularized));
}

}  // namespace candela::integrators
