// The mutations that a job may name, one line each.
#pragma once

#include <memory>
#include <span>
#include <string_view>

#include "worker/mcmc/mutators/context.h"
#include "worker/mcmc/mutators/mutator.h"

namespace candela::mcmc {

struct MutatorEntry {
  std::string_view name;  // as settings have it
  double share;           // the default of its setting: 0 where it has to be asked for
  std::string_view doc;   // of its setting
  std::unique_ptr<PathMutator> (*make)(const MutatorContext& context);
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
