// Energy redistribution path tracing [Cline 2005], in a form whose iterations are independent and exact
// [metropolis-photons note, sections 1 to 4]:
//
//   pilot      from independent samples: b0, the mean of their scalar contributions I, and rho^2, their
//              relative variance. The energy of a chain is e_d = k b0, k = (1 + rho^2) / 2, and its length
//              M = m k, m the mutations for each seed
//   unit(i)    N seeds, each an independent path of bidirectional path tracing, and their chains
//              (mcmc/redistribution.h); path tracing of what is left to it
//
// The states of chains are paths, and mutations those of mlt (mcmc/path_space.h). Against [Cline 2005]: e_d
// is not b, and nothing is filtered. The pilot decides noise and work alone: any e_d and M give the same
// mean. No normalization is pooled, and no chain goes on to another iteration.
//
// This file has the settings, the plan, and a unit's seeds.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "common/chains/mutation_sums.h"
#include "worker/estimators/film_domain.h"
#include "worker/estimators/path_dispatch.h"
#include "worker/integrators/chains/first_stage.h"
#include "worker/integrators/erpt/pilot.h"
#include "worker/integrators/erpt/settings.h"
#include "worker/integrators/eye_samples.h"
#include "worker/integrators/iteration_integrator.h"
#include "worker/integrators/makers.h"
#include "worker/integrators/path/plan.h"
#include "worker/mcmc/film_deposit.h"
#include "worker/mcmc/path_space.h"
#include "worker/mcmc/redistribution.h"

namespace candela::integrators {
namespace {

// The longest path if there is no limit, in edges.
constexpr std::uint32_t kLongest = 1000;
constexpr std::uint64_t kSeedChunk = 64;                 // of one task
constexpr std::uint64_t kSeeds = 0x6572707473656564ULL;  // "erptseed"
enum Purpose : std::uint64_t { sample, rounding, mutations };
constexpr std::uint32_t kMollifiedAt = 1;  // the layer of the film

class ErptIntegrator final : public IterationIntegrator {
 public:
  ErptIntegrator(const ErptSettings& settings, const estimators::PathOptions& direct_options, Planned direct,
                 std::uint32_t longest, const Regularization& regularization, bool letters, Plan plan)
      : IterationIntegrator(settings.common.path_options(), Planned{{}, direct.between, std::move(plan)}),
        settings_(settings),
        direct_options_(direct_options),
        direct_(std::move(direct)),
        radiance_(estimators::path_radiance_for<samplers::Sampler>(direct_.between, letters)),
        shortest_(direct_options.max_depth + 1),
        longest_(longest),
        regularization_(regularization),
        shares_(settings.mutations.chosen()) {}

  Result<Decision> decide(const UnitContext& context, const RunContext& run) const override {
    // The film of an irradiance meter lies over its surface, where the lens of a camera is.
    float weight = 1;
    if (context.scene.reads_lens() &&
        !(context.scene.near_distance(context.scene.camera_ray(0.5f, 0.5f, {0.5f, 0.5f}, weight)) > 0))
      return usage_error("erpt has no paths to an irradiance meter")
          .with_field("integrator")
          .with_mend("use path, bdpt, pssmlt or mmlt");
    Decision decision{{}, plan()};
    if (!has_chains()) return decision;
    const auto samples = static_cast<std::uint64_t>(settings_.bootstrap);
    erpt::Decided decided;
    if (settings_.two_stage) {
      const estimators::PathOptions all = settings_.common.path_options();
      CANDELA_ASSIGN(decided.importance, chain_jobs::first_stage(context, all, samples, decision.plan, run));
    }
    CANDELA_ASSIGN(const erpt::SeedStatistics statistics,
                   erpt::seed_statistics(
                       [&](film::SampleCounts& /*sample_counts*/) { return make_space(context, 0, nullptr); },
                       context.seed, samples, run, decided.importance.used()));
    decided.energies = erpt::choose_energies(statistics, settings_, decision.plan);
    decision.bytes = erpt::to_bytes(decided);
    return decision;
  }

  WorkPlan work(FilmSize /*size*/, const NamedState& /*state*/) const override {
    WorkPlan plan;
    if (regularization_.layer()) plan.layers = {kMollifiedLayer};
    for (const mcmc::MutatorShare& share : shares_)
      if (has_chains()) plan.accumulators.push_back(chains::mutation_spec(share.entry->name));
    return plan;
  }

  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& input, UnitOutput& output,
                   const RunContext& run) const override {
    film::UnitFilm& film = *output.film;
    if (has_chains()) {
      CANDELA_ASSIGN(const erpt::Decided decided,
                     erpt::decided_of(input.state.decided, context.width, context.height));
      CANDELA_TRY(run_seeds(context, unit, decided, output, run));
    }
    return run_direct(context, unit, film, run);
  }

 private:
  bool has_chains() const { return longest_ >= shortest_; }

  // Chains end with their iteration, and have its radius. [regularisation note, section 8]
  std::unique_ptr<mcmc::StateSpace> make_space(const UnitContext& context, std::uint64_t iteration,
                                               const transport::PathLetters* letters) const {
    const estimators::FilmDomain film(context.filter, context.width, context.height);
    return std::make_unique<mcmc::PathSpace>(
        mcmc::MutatorContext{context.scene, static_cast<double>(context.width),
                             static_cast<double>(context.height), film.border(), shortest_, longest_,
                             regularization_.runs() ? regularization_.bandwidth(iteration) : 0},
        shares_, letters);
  }

  Result<void> run_seeds(const UnitContext& context, const Unit& unit, const erpt::Decided& decided,
                         UnitOutput& output, const RunContext& run) const {
    film::UnitFilm& film = *output.film;
    const erpt::Energies& energies = decided.energies;
    const double pixels = static_cast<double>(context.width) * context.height;
    const auto seeds = static_cast<std::uint64_t>(std::ceil(settings_.seeds * pixels));
    const std::uint64_t chunks = (seeds + kSeedChunk - 1) / kSeedChunk;
    const mcmc::RedistributionRules rules{energies.energy, energies.mutations,
                                          static_cast<double>(settings_.max_chains),
                                          decided.importance.used()};
    const double factor = pixels / (static_cast<double>(energies.mutations) * static_cast<double>(seeds));
    const transport::Splatter splatter(context.filter, film, context.width, context.height);
    return for_each_task(
        chunks * (unit.end - unit.begin), film, run,
        [&](std::uint64_t task, film::SampleCounts& sample_counts) {
          const std::uint64_t index = unit.begin + task / chunks, from = task % chunks * kSeedChunk;
          const auto space = make_space(context, global_iteration(unit.half, index), context.letters);
          const mcmc::ChainOutlets outlets{&splatter,
                                           sample_counts,
                                           run.stop,
                                           nullptr,
                                           run.fault,
                                           context.letters,
                                           regularization_.layer() ? kMollifiedAt : 0};
          mcmc::FilmDeposit deposit(outlets, factor);
          mcmc::RedistributionCounts counts;
          for (std::uint64_t j = from; j < std::min(from + kSeedChunk, seeds); ++j) {
            if (run.stopped()) return;
            const auto key = [&](Purpose purpose) {
              return rng::key(context.seed, kSeeds, unit.half, index, j, purpose);
            };
            if (!mcmc::redistribute(*space, {key(sample), key(rounding), key(mutations)}, rules, outlets,
                                    deposit, counts))
              return;
          }
          const std::vector<chains::MutationCounts> by_mutation = space->take_counts();
          for (std::size_t i = 0; i < by_mutation.size(); ++i)
            chains::add_counts(by_mutation[i], task, *output.accumulators[i], sample_counts);
        });
  }

  // The samples of iteration i are those of index i s ... i s + s - 1, s their number.
  Result<void> run_direct(const UnitContext& context, const Unit& unit, film::UnitFilm& film,
                          const RunContext& run) const {
    const auto samples = static_cast<std::uint64_t>(settings_.direct_samples);
    Unit of_samples = unit;
    of_samples.begin *= samples;
    of_samples.end *= samples;
    RunContext quiet = run;  // seeds are nearly all of the work
    if (has_chains()) quiet.progress = nullptr;
    const float weight = 1 / static_cast<float>(samples);
    return run_eye_samples(context, of_samples, film, quiet,
                           [&](const Ray& ray, samplers::Sampler& sampler, film::SampleCounts& sample_counts,
                               transport::EyeLetters* letters) {
                             const Spectrum value =
                                 radiance_(context.scene, direct_options_, direct_.techniques, ray, sampler,
                                           sample_counts, nullptr, letters) *
                                 weight;
                             if (letters != nullptr) letters->sums().scale(weight);
                             return value;
                           });
  }

  const ErptSettings settings_;
  const estimators::PathOptions direct_options_;
  const Planned direct_;
  const estimators::RadianceFunction<samplers::Sampler> radiance_;
  const std::uint32_t shortest_, longest_;
  const Regularization regularization_;
  const std::vector<mcmc::MutatorShare> shares_;
};

}  // namespace

ErptMutations::ErptMutations() {
  constexpr std::array<std::string_view, 3> kUsed{"lens", "caustic", "multichain"};
  for (const mcmc::MutatorEntry& entry : mcmc::mutators())
    shares.push_back(std::find(kUsed.begin(), kUsed.end(), entry.name) != kUsed.end() ? 1 : 0);
}

std::vector<mcmc::MutatorShare> ErptMutations::chosen() const {
  const bool manifolds = preset.value == "mept";
  std::vector<mcmc::MutatorShare> out;
  for (std::size_t i = 0; i < shares.size(); ++i) {
    const mcmc::MutatorEntry& entry = mcmc::mutators()[i];
    const double share = !manifolds ? shares[i] : entry.name == "manifold" ? 1 : 0;
    if (share > 0) out.push_back({&entry, share});
  }
  return out;
}

Result<void> check(const ErptSettings& settings) {
  const std::vector<double>&shares = settings.mutations.shares, defaults = ErptMutations().shares;
  for (std::size_t i = 0; settings.mutations.preset.value != "erpt" && i < shares.size(); ++i)
    if (shares[i] != defaults[i])
      return usage_error("preset = " + settings.mutations.preset.value + " has shares of its own")
          .with_field(std::string(mcmc::mutators()[i].name))
          .with_mend("leave out this share, or preset");
  if (!settings.mutations.chosen().empty()) return {};
  return usage_error("no mutation has a share")
      .with_field(std::string(mcmc::mutators().front().name))
      .with_mend("give one of the mutations a share above 0");
}

Result<std::unique_ptr<Integrator>> make_erpt_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const ErptSettings parsed, parse_settings<ErptSettings>(settings));
  CANDELA_TRY(check(parsed));
  const auto refuse = [](std::string what, std::string_view field, std::string mend) {
    return usage_error(std::move(what)).with_field(std::string(field)).with_mend(std::move(mend));
  };
  if (features.any_heterogeneous_medium)
    return refuse("erpt needs the transmittance of each path, which grids of extinction have no formula for",
                  "integrator", "use bdpt, upbp, pssmlt or mmlt, or homogeneous media");
  if (!features.edits.empty())
    return refuse("erpt does not render edits: " + features.edits.front(), "integrator",
                  "use bdpt, pssmlt or mmlt, or leave out the edits");

  const estimators::PathOptions options = parsed.common.path_options();
  estimators::PathOptions direct_options = options;
  const bool bounce = parsed.direct.value == "path";
  direct_options.max_depth = std::min(options.max_depth, bounce ? 2U : 1U);
  direct_options.heuristic = transport::MisHeuristic::power;
  Planned direct = path::plan(direct_options, features, parsed.common.full_plan());
  Plan plan;
  plan.use("path tracing beside the chains", bounce ? "direct=path: paths of one and two edges are left to it"
                                                    : "emitters that the camera sees are left to it");
  for (const mcmc::MutatorShare& one : parsed.mutations.chosen())
    plan.use(std::string(one.entry->name), fmt::format("share {:.3g}: {}", one.share, one.entry->doc));
  const std::uint32_t shortest = bounce ? 3 : 2, longest = std::min(options.max_depth, kLongest);
  if (longest < shortest) {
    plan.skip("chains", "max_depth leaves nothing to them");
  } else {
    plan.use("path lengths", fmt::format("from {} to {} edges", shortest, longest));
    if (options.max_depth > kLongest)
      plan.note("path lengths", fmt::format("light of paths of more than {} edges is missing", kLongest));
    note_lucky_light(features, longest, Finds::connections, parsed.regularise.mollifies(), plan);
  }
  const Regularization regularization = plan_regularization(parsed.regularise, features, options.max_depth,
                                                            transport::Connecting::bidirectional, plan);
  CANDELA_TRY(check(regularization, features));
  if (regularization.runs() && bounce)
    return refuse("the path tracing of direct=path finds nothing that is mollified", "direct",
                  "give direct=chain, or regularise=off");
  return std::unique_ptr<Integrator>(
      std::make_unique<ErptIntegrator>(parsed, direct_options, std::move(direct), longest, regularization,
                                       features.reads_letters, std::move(plan)));
}

}  // namespace candela::integrators
