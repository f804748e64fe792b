#include "worker/integrators/chains/chain_integrator.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "worker/integrators/chains/direct_light.h"
#include "worker/integrators/chains/first_stage.h"
#include "worker/integrators/chains/step_sizes.h"
#include "worker/integrators/parallel_tasks.h"
#include "worker/integrators/pilot/eye_walk.h"
#include "worker/mcmc/chain.h"

namespace candela::integrators {
namespace {

constexpr std::uint64_t kBootstrapChunk = 256;
constexpr std::string_view kDecision = "mcm3";  // step sizes, and the importance of the film
// The first stage has a quarter of the bootstrap's number of samples.
constexpr std::uint64_t kFirstStageShare = 4;

std::uint64_t divide_up(std::uint64_t a, std::uint64_t b) {
  return (a + b - 1) / b;
}

// Features of a scene that ordinary sampling finds hard.
std::string reasons_for_chains(const scene::SceneFeatures& f) {
  std::string reasons;
  const auto add = [&](bool is, std::string_view what) {
    if (is) reasons.append(reasons.empty() ? "" : ", ").append(what);
  };
  add(f.any_delta_bsdf, "specular surfaces");
  add(f.any_rough_glossy, "glossy surfaces");
  add(f.any_scattering_medium, "scattering media");
  add(f.emitters > 1, "emitters that may be hidden from most of the scene");
  return reasons;
}

}  // namespace

Result<void> check(const ChainSettings& settings) {
  if (settings.chains % 2 != 0)
    return usage_error("the number of chains is odd")
        .with_field("chains")
        .with_mend("one half of them estimates the image beside the other half: give an even number");
  return {};
}

Result<void> check(const PrimarySettings& settings) {
  if (settings.step_least > settings.step_most)
    return usage_error("the smallest step is larger than the largest")
        .with_field("step_least")
        .with_mend("give at most step_most");
  return {};
}

ChainIntegrator::ChainIntegrator(const ChainSettings& settings, const estimators::PathOptions& options,
                                 const scene::SceneFeatures& features, bool full_plan, std::uint32_t shortest)
    : settings_(settings),
      direct_by_path_(settings.direct.value == "path" || shortest > options.min_edges),
      all_options_(options),
      chain_options_(options) {
  if (direct_by_path_) {
    direct_options_ = options;
    const std::uint32_t longest = settings.direct.value == "path" ? 2 : shortest - 1;
    direct_options_.max_depth = std::min(options.max_depth, longest);
    direct_options_.heuristic = transport::MisHeuristic::power;
    direct_ = path::plan(direct_options_, features, full_plan);
    chain_options_.min_edges = longest + 1;
    plan_.use("path tracing beside the chains", longest == 2
                                                    ? "direct=path: paths of one and two edges are left to it"
                                                    : "emitters that the camera sees are left to it");
  } else {
    plan_.skip("path tracing beside the chains", "direct=chain: the chains follow light of all path lengths");
  }
  const std::string reasons = reasons_for_chains(features);
  if (reasons.empty())
    plan_.skip(
        "a gain by Metropolis",
        "nothing here is hard to find (one emitter, no specular or glossy surface, no medium): path and "
        "bdpt converge faster");
  else
    plan_.use("Metropolis", "light may be hard to find: " + reasons);
}

Result<ChainRegularization> chain_regularization(const ChainRegulariseSettings& settings,
                                                 const ChainSettings& chains,
                                                 const scene::SceneFeatures& features,
                                                 std::uint32_t max_depth, transport::Connecting techniques,
                                                 Plan& plan) {
  const Regularization regularization = plan_regularization(settings, features, max_depth, techniques, plan);
  CANDELA_TRY(check(regularization, features));
  if (!regularization.runs()) return ChainRegularization();
  if (chains.direct.value == "path")
    return usage_error("the path tracing of direct=path finds nothing that is mollified")
        .with_field("direct")
        .with_mend("give direct=chain, or regularise=off");
  const bool geometric = settings.schedule.value == "geometric";
  if (geometric)
    plan.note("regularise_schedule",
              "a radius that falls by a constant factor for each mutation freezes the chains: their error "
              "stops falling, whatever the number of mutations");
  return ChainRegularization(regularization, geometric);
}

ChainPlan ChainIntegrator::chain_plan(FilmSize size) const {
  ChainPlan plan;
  plan.chains = static_cast<std::uint32_t>(settings_.chains);
  plan.bootstrap_samples = static_cast<std::uint64_t>(settings_.bootstrap);
  const std::uint64_t pixels = std::uint64_t{size.width} * size.height;
  plan.segment_mutations = divide_up(pixels * static_cast<std::uint64_t>(settings_.mutations), plan.chains);
  return plan;
}

WorkPlan ChainIntegrator::work(FilmSize size, const NamedState& /*state*/) const {
  WorkPlan plan;
  plan.layers = {"independent"};
  if (regularization_.layer()) {
    plan.layers.emplace_back(kMollifiedLayer);
    plan.layers.push_back(std::string(kMollifiedLayer) + std::string(chains::kIndependentPart));
  }
  plan.chains = chain_plan(size);
  return plan;
}

Result<void> ChainIntegrator::run(const UnitContext& context, const Unit& unit, const UnitInput& input,
                                  UnitOutput& output, const RunContext& run) const {
  Decided decided;
  if (!input.state.decided.empty()) {  // else there is one stage, and nobody chose step sizes
    DecisionReader in(input.state.decided, kDecision);
    decided.sizes = chain_jobs::read_step_sizes(in, step_count());
    decided.importance = chain_jobs::read_importance(context.width, context.height, in);
    CANDELA_TRY(in.done());
  }
  return unit.kind == Unit::Kind::bootstrap ? run_bootstrap(context, unit, decided, output, run)
                                            : run_segments(context, unit, input, decided, output, run);
}

Result<Decision> ChainIntegrator::decide(const UnitContext& context, const RunContext& run) const {
  CANDELA_TRY(check_scene(context.scene));
  Decision decision{{}, plan_};
  const std::uint64_t samples = divide_up(static_cast<std::uint64_t>(settings_.bootstrap), kFirstStageShare);
  Decided decided;
  if (settings_.two_stage) {
    CANDELA_ASSIGN(decided.importance,
                   chain_jobs::first_stage(context, all_options_, samples, decision.plan, run));
  }
  CANDELA_ASSIGN(decided.sizes, choose_steps(context, decided.importance, decision.plan, run));
  if (decided.importance.even() && decided.sizes.empty()) return decision;
  DecisionWriter out(kDecision);
  chain_jobs::write(decided.sizes, out);
  chain_jobs::write(decided.importance, out);
  decision.bytes = out.bytes();
  return decision;
}

Result<void> ChainIntegrator::run_bootstrap(const UnitContext& context, const Unit& unit,
                                            const Decided& decided, UnitOutput& output,
                                            const RunContext& run) const {
  std::vector<float>& contributions = output.table;
  contributions.assign(unit.end - unit.begin, 0);
  film::UnitFilm counts_only({1, 1, 1}, 0);
  CANDELA_TRY(for_each_task(
      divide_up(unit.end - unit.begin, kBootstrapChunk), counts_only, run,
      [&](std::uint64_t chunk, film::SampleCounts& sample_counts) {
        const auto space = make_space(context, sample_counts, {regularization_.bandwidth(0), decided.sizes});
        mcmc::SplatList list(decided.importance.used());
        const std::uint64_t from = unit.begin + chunk * kBootstrapChunk;
        for (std::uint64_t i = from; i < std::min(from + kBootstrapChunk, unit.end); ++i) {
          if (run.stopped()) return;
          const std::uint64_t key = mcmc::bootstrap_key(context.seed, i);
          space->start(key, list);
          if (run.fault != nullptr && !list.splats().empty()) {
            run.fault(key, &list.editable()[0].value.r);
            list.sum_again();
          }
          contributions[i - unit.begin] = static_cast<float>(mcmc::usable_scalar(list, sample_counts));
        }
      }));
  output.counts = counts_only.sample_counts();
  return {};
}

Result<void> ChainIntegrator::run_segments(const UnitContext& context, const Unit& unit,
                                           const UnitInput& input, const Decided& decided, UnitOutput& output,
                                           const RunContext& run) const {
  const ChainPlan plan = chain_plan({context.width, context.height});
  const auto starts = input.starts;
  film::UnitFilm& film = *output.film;
  std::vector<chains::ChainRecord>& records = output.records;
  const std::uint64_t count = unit.end - unit.begin;
  mcmc::ChainRules rules;
  rules.seed = context.seed;
  rules.b0 = input.state.bootstrap_b;
  rules.prob_large = settings_.large_step;
  rules.segment_mutations = plan.segment_mutations;
  rules.pixels = static_cast<double>(context.width) * context.height;
  rules.states_vanish = regularization_.runs();
  rules.importance = decided.importance.used();
  // If the radius stays, the bootstrap's samples are like all others, and b is one mean.
  constexpr std::uint64_t kLate = std::uint64_t{1} << 40;
  const bool stays = !(regularization_.bandwidth(kLate) < regularization_.bandwidth(0));
  if (!std::isfinite(input.state.bootstrap_b) || input.state.bootstrap_b < 0)
    return internal_error("the first estimate of b is negative or not finite");
  const bool dark = !(input.state.bootstrap_b > 0);
  const std::uint64_t direct_samples = divide_up(
      std::uint64_t{context.width} * context.height * static_cast<std::uint64_t>(settings_.direct_samples),
      plan.chains);
  const chain_jobs::DirectLight direct(context, direct_options_, direct_, direct_samples, unit.half);
  const transport::Splatter splatter(context.filter, film, context.width, context.height);

  records.assign(count, {});
  std::vector<std::optional<Error>> errors(count);
  mcmc::ChainProgress progress(static_cast<double>(count) * static_cast<double>(plan.segment_mutations),
                               run.progress);
  RunContext quiet = run;  // progress is that of mutations: a segment may take long
  quiet.progress = nullptr;
  const auto segment = [&](std::uint64_t i, film::SampleCounts& sample_counts) {
    const std::uint64_t index = unit.begin + i;
    if (starts[i].record.segments != chains::segment_of(index, plan.chains)) {
      errors[i] =
          input_error("a chain's record is not that of the segment before").with_field("chain_starts");
      return;
    }
    if (dark) {  // nothing to follow
      records[i] = starts[i].record;
      ++records[i].segments;
      progress.add(plan.segment_mutations);
    } else {
      const std::uint64_t begin = starts[i].record.segments * plan.segment_mutations;
      const auto space =
          make_space(context, sample_counts, {regularization_.bandwidth(begin), decided.sizes});
      const mcmc::ChainOutlets outlets{&splatter,
                                       sample_counts,
                                       run.stop,
                                       &progress,
                                       run.fault,
                                       context.letters,
                                       regularization_.layer() ? chains::kImageLayers : 0};
      const auto done = mcmc::run_segment(*space, rules, chains::chain_of(unit.half, index, plan.chains),
                                          starts[i], outlets, records[i]);
      if (!done.ok()) errors[i] = done.error();
      if (stays) records[i].counts.mollified.reset();
    }
    if (direct_by_path_) direct.add(index, mcmc::kIndependentLayer, film, sample_counts, run);
  };
  CANDELA_ASSIGN(const std::uint64_t done, for_first_tasks(count, film, quiet, segment));
  records.resize(done);
  for (const auto& error : errors)
    if (error) return *error;
  return {};
}

std::vector<float> ChainIntegrator::pilot_luminances(const UnitContext& context, std::uint32_t count) const {
  return pilot_by_eye_walk(context, count, all_options_);
}

}  // namespace candela::integrators
