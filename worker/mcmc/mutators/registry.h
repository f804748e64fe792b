// The mutations that a job may name, one line each.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

#include "worker/mcmc/mutators/mutator.h"

namespace candela::mcmc {

// What mutators are made for.
struct MutatorContext {
  const scene::Scene& scene;  // must outlive them
  // Film in pixels, and the pixels around it that count as on it.
  double film_width = 1, film_height = 1;
  float film_border = 0;
  // Paths of the chain, in edges: of others no proposal is made.
  std::uint32_t min_edges = 1, max_edges = 64;
};

struct MutatorEntry {
  std::string_view name;  // of the setting, too
  double share;           // default of the setting: 0 where it has to be asked for
  std::string_view doc;   // of the setting
  std::unique_ptr<PathMutator> (*make)(const MutatorContext& context);
};

// In the order in which states choose among them; `bidirectional` first.
std::span<const MutatorEntry> mutators();

}  // namespace candela::mcmc
