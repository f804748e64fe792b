// The pilot of erpt: independent samples before the job decide the energy of a chain, and its length.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "worker/integrators/erpt/settings.h"
#include "worker/integrators/integrator.h"
#include "worker/mcmc/image_importance.h"
#include "worker/mcmc/mutators/registry.h"
#include "worker/mcmc/state_space.h"

namespace candela::integrators::erpt {

struct SeedStatistics {
  double b0 = 0;              // mean of I
  double mean_square = 0;     // of I
  std::uint64_t samples = 0;  // all
  std::uint64_t lit = 0;      // those of I > 0

  // 1 + rho^2 = E[I^2] / b0^2, at least 1.
  double one_plus_variance() const;
};

using MakeSpace = std::function<std::unique_ptr<mcmc::StateSpace>(film::SampleCounts&)>;

// importance: of the film; null: 1 everywhere. Fails only if it is stopped.
Result<SeedStatistics> seed_statistics(const MakeSpace& make_space, std::uint64_t seed, std::uint64_t samples,
                                       const RunContext& run,
                                       const mcmc::ImageImportance* importance = nullptr);

struct Energies {
  double energy = 1;            // e_d
  std::uint64_t mutations = 1;  // of a chain
};
// The job's choice, and its line in the plan.
Energies choose_energies(const SeedStatistics& statistics, const ErptSettings& settings, Plan& plan);

// The pilot decides these for the whole job.
struct Decided {
  Energies energies;
  std::vector<mcmc::StepSize> sizes;  // of steps, of each share; none: the default
  mcmc::ImageImportance importance;
};
std::string to_bytes(const Decided& decided);
// Film size, and number of mutations: of the job.
Result<Decided> decided_of(std::string_view bytes, std::uint32_t width, std::uint32_t height,
                           std::size_t shares);

}  // namespace candela::integrators::erpt
