#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "worker/integrators/chains/settings.h"
#include "worker/integrators/common_settings.h"
#include "worker/mcmc/mutators/registry.h"

namespace candela::integrators {

// Shares of mutations, in the order of mcmc::mutators().
struct MutatorSettings {
  static constexpr std::string_view kOwn = "none";

  Choice preset{std::string(kOwn), {kOwn}};
  std::vector<double> shares;

  MutatorSettings() {
    for (const mcmc::MutatorPreset& known : mcmc::mutator_presets()) preset.names.push_back(known.name);
    for (const mcmc::MutatorEntry& entry : mcmc::mutators()) shares.push_back(entry.share);
  }
  template <class Visitor>
  void fields(Visitor& visit) {
    visit("preset", preset,
          "mutations and shares that go well together, in place of the shares below: mlt (Veach's), memlt "
          "(manifold exploration), hslt (half vectors)");
    for (std::size_t i = 0; i < shares.size(); ++i)
      visit(mcmc::mutators()[i].name, shares[i], NumberRange{0, 1}, mcmc::mutators()[i].doc);
  }
};
// One of the shares is above 0; with a preset all have their defaults.
Result<void> check(const MutatorSettings& settings);

struct MltSettings {
  CommonSettings common{integrator_words::kMlt};
  ChainSettings chains;
  MutatorSettings mutations;
  ChainRegulariseSettings regularise;

  // Mutations find light that is rare, large steps do not; and paths of two edges have little noise.
  MltSettings() {
    chains.direct.value = "path";
    chains.large_step = 0.05;
    chains.direct_samples = 4;
  }

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit, integrator_words::kRrDepth.minimum,
                       "not read: paths of the chains have no Russian roulette, and those of path tracing "
                       "beside them are short");
    chains.fields(visit, mutations);
    regularise.fields(visit);
    common.plan_field(visit);
  }
};
inline Result<void> check(const MltSettings& settings) {
  return check(settings.mutations);
}

}  // namespace candela::integrators
