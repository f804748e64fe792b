// The mutations that a job may name, one line each.
#pragma once

#include <memory>
#include <span>
#include <string_view>

#include "worker/mcmc/mutators/context.h"
#include "worker/mcmc/mutators/mutator.h"

namespace candela::mcmc {

// The size of a mutation's steps, as factors of the sizes that it has by itself.
struct StepSize {
  double image = 1;      // of steps of the film position
  double roughness = 1;  // of steps of slopes, in units of the roughness of lobes: gamma
  bool operator==(const StepSize&) const = default;
};

struct MutatorEntry {
  std::string_view name;  // as settings have it
  double share;           // the default of its setting: 0 where it has to be asked for
  std::string_view doc;   // of its setting
  std::unique_ptr<PathMutator> (*make)(const MutatorContext& context, const StepSize& size);
  bool has_image_step = false, has_roughness_step = false;  // factors that it reads; others do nothing
};

// In the order in which a chain chooses among them; `bidirectional` is the first.
std::span<const MutatorEntry> mutators();

// Mutations that are known to go well together, with their shares.
struct MutatorPreset {
  std::string_view name;
  std::span<const MutatorEntry> mutations;
};
std::span<const MutatorPreset> mutator_presets();

}  // namespace candela::mcmc
