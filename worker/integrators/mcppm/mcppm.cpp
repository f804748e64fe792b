// Photon mapping with Metropolis chains of visible photons [Hachisuka 2011], in a form whose iterations are
// independent and exact [metropolis-photons note, section 6]:
//
//   unit(i):  r = r_i, theta = the step size of i's epoch; N, M settings
//     eye paths      the places where they gather photons, in a range search
//     light paths    N independent ones. Path u is visible if it leaves a photon within r of such a place;
//                    v paths are, numbered c = 0 ... v - 1. v = 0: the iteration is black, and counts
//     chains         path c starts a chain of L = M div v + (c < M mod v) mutations, which accepts what is
//                    visible. Each of its 1 + L states adds its photons with the weight 1 / (N (1 + L))
//     gathering      as ppm, from the photons of all states
//
// Given which paths are visible, every state is uniform on the visible set, so the expectation is that of ppm
// with the same radius: for any N, M and theta, whether chains mix or not. Nothing but "visible or not"
// enters L and the weights. Against [Hachisuka 2011]: no chain goes on to another iteration, no normalization
// is pooled over iterations, no step size adapts inside one.
#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "common/adaptive/levels.h"
#include "common/stages/photon_chains.h"
#include "common/stats/inner_merges.h"
#include "worker/integrators/adaptive/settings.h"
#include "worker/integrators/decision_bytes.h"
#include "worker/integrators/iteration_integrator.h"
#include "worker/integrators/makers.h"
#include "worker/integrators/mcppm/photon_pass.h"
#include "worker/integrators/mcppm/pilot.h"
#include "worker/integrators/mcppm/settings.h"
#include "worker/integrators/merging/chosen_radius.h"
#include "worker/integrators/merging/first_radius.h"
#include "worker/integrators/merging/iterations.h"
#include "worker/integrators/merging/one_radius.h"
#include "worker/integrators/plan_edge_content.h"
#include "worker/integrators/ppm/plan.h"

namespace candela::integrators {
namespace {

// The values of the decision: the radius, and 1 if chains run; with split=pilot the light paths and mutations
// of an iteration, too.
constexpr std::string_view kKind = "mcp1", kSplitKind = "mcs1";

// Least and largest distance of a mutation [Kelemen 2002, Sec. 3.2].
mcmc::StepSizes step_sizes(double step) {
  return {step / 16, step};
}

class McppmIntegrator final : public IterationIntegrator {
 public:
  McppmIntegrator(const McppmSettings& settings, Planned planned)
      : IterationIntegrator(settings.common.path_options(), std::move(planned)),
        settings_(settings),
        iterations_{options_, planned_.techniques, settings.merge.rules(),
                    settings.photons.value == "caustics"},
        may_chain_(planned_.techniques.merges() && settings.mutations_per_path > 0) {}

  Result<Decision> decide(const UnitContext& context, const RunContext& run) const override {
    if (!may_chain_) return merging::decide_radius(plan(), context, iterations_);
    Decision decision{{}, plan()};
    const merging::ChosenRadius radius =
        merging::choose_radius(context, iterations_.merge, options_, planned_.techniques);
    merging::note_radius(radius, context, decision.plan);
    CANDELA_ASSIGN(const mcppm::VisibleFraction fraction,
                   mcppm::visible_fraction(planned_.between, context, iterations_, radius.value, run));
    mcppm::IterationSize size = size_by_setting(context);
    if (splits()) size = mcppm::split_by(fraction, size, static_cast<double>(context.width) * context.height);
    const bool chains = mcppm::decide_chains(fraction, size, settings_.common.full_plan(), decision.plan);
    DecisionWriter out(splits() ? kSplitKind : kKind);
    out.real(radius.value);
    out.count(chains ? 1 : 0);
    if (splits()) {
      out.count(size.light_paths);
      out.count(size.mutations);
    }
    decision.bytes = out.bytes();
    return decision;
  }

  WorkPlan work(FilmSize size, const NamedState& state) const override {
    WorkPlan plan;
    if (planned_.techniques.merges())
      plan.accumulators = {stats::inner_merges_spec(size.width, size.height, state.film_scale_log2)};
    if (!may_chain_) return plan;
    plan.epochs = EpochPlan{
        static_cast<std::uint64_t>(settings_.epochs.epoch_min),
        static_cast<std::uint32_t>(settings_.epochs.growth),
        static_cast<std::uint32_t>(settings_.epochs.lag),
        std::string(photon_chains::kRule),
        {{std::string(photon_chains::kFirstStep), candela::adaptive::constant_text(settings_.step)}}};
    const Result<Decided> decided = read(state.decided);
    if (!decided.ok() || decided->chains)
      plan.accumulators.insert(plan.accumulators.begin(), photon_chains::spec(size.width, size.height));
    return plan;
  }

  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& input, UnitOutput& output,
                   const RunContext& run) const override {
    if (!may_chain_)
      return merging::run_ppm(planned_.between, context, unit, input, iterations_, output, run);
    CANDELA_ASSIGN(const Decided decided, read(input.state.decided));
    if (!decided.chains) {
      UnitInput of_ppm = input;
      of_ppm.state.decided = merging::radius_bytes(decided.radius);
      return merging::run_ppm(planned_.between, context, unit, of_ppm, iterations_, output, run);
    }
    const auto state = input.states.find(photon_chains::kRule);
    CANDELA_ASSIGN(const double step,
                   photon_chains::step_of(state == input.states.end() ? std::string_view() : state->second));
    return with_edge_content(planned_.between, [&](auto between) {
      return run_chains<between()>(context, unit, decided, step_sizes(step), output, run);
    });
  }

 private:
  struct Decided {
    double radius;
    bool chains;
    mcppm::IterationSize split;  // with split=pilot
  };
  bool splits() const { return settings_.split.value == "pilot"; }
  Result<Decided> read(std::string_view bytes) const {
    DecisionReader in(bytes, splits() ? kSplitKind : kKind);
    Decided decided{};
    decided.radius = in.real(merging::kMinRadius, merging::kGreatestRadius);
    decided.chains = in.count(2) == 1;
    if (splits()) {
      constexpr std::uint64_t kEnd = 1ULL << 48;
      decided.split.light_paths = std::max<std::uint64_t>(1, in.count(kEnd));
      decided.split.mutations = in.count(kEnd);
    }
    CANDELA_TRY(in.done());
    return decided;
  }

  mcppm::IterationSize size_by_setting(const UnitContext& context) const {
    const std::uint64_t paths = merging::light_path_count(iterations_.merge, context);
    return {paths,
            static_cast<std::uint64_t>(settings_.mutations_per_path * static_cast<double>(paths) + 0.5)};
  }

  template <transport::EdgeContent kEdgeContent>
  Result<void> run_chains(const UnitContext& context, const Unit& unit, const Decided& decided,
                          mcmc::StepSizes steps, UnitOutput& output, const RunContext& run) const {
    using Eye = estimators::PpmEye<kEdgeContent, transport::ConstantScale>;
    using mcppm::Block;
    const estimators::Techniques& techniques = iterations_.techniques;
    const mcppm::IterationSize size = splits() ? decided.split : size_by_setting(context);
    const std::uint64_t path_count = size.light_paths, mutations = size.mutations;
    const auto paths = static_cast<double>(path_count);
    const estimators::PathCounts counts{static_cast<double>(context.width) * context.height, paths,
                                        static_cast<float>(context.filter.radius())};
    const merging::ProgressiveScales<transport::Unweighted> scales(iterations_.merge, decided.radius, paths,
                                                                   techniques);
    film::UnitFilm& film = *output.film;
    mcppm::GatherPlaces places;
    merging::LightChunks<Block> photons;
    transport::PhotonMap<Block> surface, medium;
    const std::uint64_t parts = 4 * (unit.end - unit.begin);
    std::uint64_t part = 0;
    for (std::uint64_t index = unit.begin; index < unit.end; ++index) {
      estimators::LightSide<Block, transport::ConstantScale> side{
          {}, photons, path_count, scales.field(global_iteration(unit.half, index)), context.letters};
      const transport::MergeScale& scale = side.field.scale;
      CANDELA_TRY(places.trace<kEdgeContent>(context, iterations_, counts, scale, unit.half, index, film, run,
                                             progress_part(part++, parts)));
      const mcppm::PhotonPass pass{context, iterations_, counts, places, unit.half, index};
      CANDELA_ASSIGN(const std::vector<std::uint64_t> visible,
                     mcppm::visible_paths<kEdgeContent>(pass, film, run, progress_part(part++, parts)));
      CANDELA_ASSIGN(const std::uint64_t accepted,
                     mcppm::spread<kEdgeContent>(pass, visible, mutations, steps, photons, film, run,
                                                 progress_part(part++, parts)));
      side.maps.max_edges = iterations_.paths.max_depth;
      side.maps.per_path = static_cast<float>(1 / paths);
      side.maps.max_density = Eye::max_density(context.scene);
      if (techniques.merge_surface) {
        CANDELA_TRY(merging::build_photon_map(photons, &mcppm::PhotonStore::surface, scale.disc_radius,
                                              run.threads, surface));
        side.maps.surface = &surface;
      }
      if (techniques.merge_medium) {
        CANDELA_TRY(merging::build_photon_map(photons, &mcppm::PhotonStore::medium, scale.ball_radius,
                                              run.threads, medium));
        side.maps.medium = &medium;
      }
      CANDELA_TRY(merging::run_eye_pass<Eye>(context, iterations_, counts, side, {}, unit.half, index, output,
                                             run, progress_part(part++, parts)));
      count(visible.size(), path_count, visible.empty() ? 0 : mutations, accepted,
            rng::key(context.seed, unit.half, index), context, output);
    }
    return {};
  }

  static void count(std::uint64_t visible, std::uint64_t light_paths, std::uint64_t mutations,
                    std::uint64_t accepted, std::uint64_t key, const UnitContext& context,
                    UnitOutput& output) {
    if (output.accumulators.empty()) return;
    film::SampleCounts sample_counts;
    photon_chains::add(
        {1, visible == 0 ? 1U : 0U, light_paths, visible, mutations, accepted, visible * visible}, key,
        *output.accumulators[0], context.width, sample_counts);
    output.film->count(sample_counts);
  }

  const McppmSettings settings_;
  const merging::IterationOptions iterations_;
  const bool may_chain_;  // the pilot decides whether they pay
};

}  // namespace

Result<std::unique_ptr<Integrator>> make_mcppm_integrator(const SettingsMap& settings,
                                                          const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const McppmSettings parsed, parse_settings<McppmSettings>(settings));
  CANDELA_TRY(adaptive::check(parsed.epochs));
  Planned planned = ppm::plan(parsed.common.path_options(), parsed.photons.value == "caustics", features,
                              parsed.common.full_plan());
  if (planned.techniques.merges() && parsed.mutations_per_path == 0)
    planned.plan.skip("chains of visible photons", "mutations_per_path=0");
  return std::unique_ptr<Integrator>(std::make_unique<McppmIntegrator>(parsed, std::move(planned)));
}

}  // namespace candela::integrators
