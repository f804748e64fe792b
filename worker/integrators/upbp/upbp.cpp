// Unified points, beams and paths [Krivanek 2014]: vcm with merges of points and beams in media.
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "worker/integrators/decision_bytes.h"
#include "worker/integrators/iteration_integrator.h"
#include "worker/integrators/makers.h"
#include "worker/integrators/merging/chosen_radius.h"
#include "worker/integrators/merging/first_radius.h"
#include "worker/integrators/merging/iterations.h"
#include "worker/integrators/pilot/trial_runs.h"
#include "worker/integrators/upbp/beam_maps.h"
#include "worker/integrators/upbp/rules.h"
#include "worker/integrators/upbp/settings.h"
#include "worker/integrators/vcm/plan.h"
#include "worker/integrators/vcm/settings.h"

namespace candela::integrators {
namespace {

using estimators::PathOptions;
using estimators::Techniques;
using transport::EdgeContent;
using upbp::MediumRules;
using upbp::Rules;

// One set of techniques.
struct Variant {
  Variant(Rules rules_, const PathOptions& paths, const merging::MergeRules& merge, const std::string& layers)
      : rules(std::move(rules_)), iterations{paths, rules.planned.techniques, merge,
                                             false, layers == "merging",      layers == "techniques"} {}

  const Rules rules;
  merging::IterationOptions iterations;
};

class UpbpIntegrator final : public IterationIntegrator {
 public:
  // variants: each has all techniques of those before. setting: the user's, by which the pilot chooses among
  // them. has_pilot: a pilot runs, chooses, and counts the hits that weights expect; else variants is one,
  // whose weights expect none.
  UpbpIntegrator(const PathOptions& options, std::vector<std::unique_ptr<Variant>> variants,
                 std::string setting, bool has_pilot)
      : IterationIntegrator(options, variants[0]->rules.planned),
        variants_(std::move(variants)),
        setting_(std::move(setting)),
        has_pilot_(has_pilot) {}

  WorkPlan work(FilmSize /*size*/, const NamedState& /*state*/) const override {
    return {.layers = variants_[0]->iterations.layers()};
  }
  Result<Decision> decide(const UnitContext& context, const RunContext& run) const override;
  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& input, UnitOutput& output,
                   const RunContext& run) const override {
    CANDELA_ASSIGN(const Decided decided, read_decision(input.state.decided));
    upbp::Measured unread;
    return run_variant(*variants_[decided.variant], decided.radius, decided.hits, context, unit, output, run,
                       unread);
  }

 private:
  // The decision that a job's units keep to.
  struct Decided {
    std::size_t variant = 0;  // the one chosen, or a refined one
    double radius = 1;        // the first, of surfaces; 1 if the variant does not merge
    upbp::ExpectedHits hits;  // of the job with what was chosen
  };
  struct Pilot {
    Decided decided;
    pilot::Choice choice;
    upbp::Memory memory;                               // of an iteration of what was chosen
    std::optional<merging::ChosenRadius> radius = {};  // if what was chosen merges
  };

  static std::string write_decision(const Decided& decided);
  Result<Decided> read_decision(std::string_view bytes) const;
  Result<Pilot> run_pilot(const UnitContext& context, const RunContext& run) const;
  // first: merging radius of the first iteration, of surfaces. hits: that weights expect.
  Result<void> run_variant(const Variant& variant, double first, const upbp::ExpectedHits& hits,
                           const UnitContext& context, const Unit& unit, UnitOutput& output,
                           const RunContext& run, upbp::Measured& measured) const;

  const std::vector<std::unique_ptr<Variant>> variants_;
  const std::string setting_;
  const bool has_pilot_;
};

// The expected number of light paths of an iteration that leave beams.
double beam_path_count(const MediumRules& rules, const UnitContext& context, std::uint64_t paths) {
  return static_cast<double>(paths) /
         static_cast<double>(upbp::beam_paths_of(rules, context, 0, paths).stride);
}

Result<void> UpbpIntegrator::run_variant(const Variant& variant, double first, const upbp::ExpectedHits& hits,
                                         const UnitContext& context, const Unit& unit, UnitOutput& output,
                                         const RunContext& run, upbp::Measured& measured) const {
  upbp::BeamMaps light(context, variant.iterations, variant.rules.medium, first, hits, measured);
  CANDELA_TRY(merging::run_iterations<upbp::BeamMaps::Eye>(context, unit, variant.iterations, light, {},
                                                           output, run));
  measured.work.rays += output.film->sample_counts().rays;
  return {};
}

constexpr pilot::SmallFilm kPilotFilm{1024, 4096, 0x63686f696365ULL};  // "choice"
constexpr double kFewConnections = 0.125;

// Every variant renders the same few iterations of a small film, of the same scene, radii and light paths per
// pixel. A pure function of the scene, the settings and the film's size, with radius_neighbors of the job's
// seed, too.
Result<UpbpIntegrator::Pilot> UpbpIntegrator::run_pilot(const UnitContext& context,
                                                        const RunContext& run) const {
  const pilot::TrialRuns runs(*this, context, run, kPilotFilm,
                              static_cast<std::uint32_t>(1 + variants_[0]->iterations.layers().size()));
  std::vector<pilot::Trial> trials;
  std::vector<upbp::Memory> memory;
  std::vector<upbp::ExpectedHits> hits;
  std::optional<merging::ChosenRadius> radius;  // all variants share that of the first one that merges
  const auto try_out = [&](const Variant& variant) -> Result<void> {
    const merging::MergeRules& merge = variant.iterations.merge;
    const Techniques& techniques = variant.iterations.techniques;
    if (techniques.merges() && !radius) radius = merging::choose_radius(context, merge, options_, techniques);
    const double first = techniques.merges() ? radius->value : 1;
    const std::uint64_t paths = merging::light_path_count(merge, context),
                        few_paths = merging::light_path_count(merge, runs.context());
    const double density = static_cast<double>(paths) / static_cast<double>(few_paths);
    upbp::Measured measured;
    CANDELA_ASSIGN(pilot::Trial trial, runs.run([&](const UnitContext& small, const Unit& unit,
                                                    UnitOutput& output, const RunContext& quiet) {
      // A replicate expects the hits of those before it, the first one none.
      return run_variant(variant, first, measured.hits.expected(), small, unit, output, quiet, measured);
    }));
    trial.cost = measured.work.cost(density);
    trials.push_back(std::move(trial));
    const MediumRules& medium = variant.rules.medium;
    const double more_beams =
        beam_path_count(medium, context, paths) / beam_path_count(medium, runs.context(), few_paths);
    memory.push_back(measured.memory.scaled(density / pilot::kReplicates, more_beams / pilot::kReplicates));
    hits.push_back(measured.hits.expected().scaled(density, more_beams));
    return {};
  };
  for (const std::unique_ptr<Variant>& variant : variants_) {
    const Rules& rules = variant->rules;
    if (rules.refined || (rules.only_if_cheap && trials.back().cost > pilot::kCheap * trials.front().cost))
      break;
    CANDELA_TRY(try_out(*variant));
  }
  Pilot result{{}, pilot::choose(trials), {}};
  Decided& decided = result.decided;
  decided.variant = result.choice.index;
  std::size_t best = result.choice.index;  // of the trials
  // One refinement, then the other, each kept if it is better.
  for (const bool fewer : {true, false}) {
    MediumRules wanted = variants_[decided.variant]->rules.medium;
    if (fewer)
      wanted.connect_media = kFewConnections;
    else
      wanted.long_query_beams = true;
    for (std::size_t v = 0; v < variants_.size(); ++v) {
      const Rules& rules = variants_[v]->rules;
      if (rules.refined != result.choice.index || rules.medium != wanted) continue;
      CANDELA_TRY(try_out(*variants_[v]));
      if (pilot::last_is_better(trials, best)) {
        decided.variant = v;
        best = trials.size() - 1;
      }
      break;
    }
  }
  if (has_pilot_) decided.hits = hits[best];
  result.memory = memory[best];
  if (variants_[decided.variant]->iterations.techniques.merges()) {
    decided.radius = radius->value;
    result.radius = std::move(radius);
  }
  return result;
}

constexpr std::string_view kKind = "upb1";  // of the decision

std::string UpbpIntegrator::write_decision(const Decided& decided) {
  DecisionWriter out(kKind);
  out.count(decided.variant);
  out.real(decided.radius);
  for (const double hits :
       {decided.hits.point_point, decided.hits.point_beam, decided.hits.beam_point, decided.hits.beam_beam})
    out.real(hits);
  return out.bytes();
}

Result<UpbpIntegrator::Decided> UpbpIntegrator::read_decision(std::string_view bytes) const {
  DecisionReader in(bytes, kKind);
  Decided decided;
  decided.variant = in.count(variants_.size());
  decided.radius = in.real(merging::kMinRadius, merging::kGreatestRadius);
  for (double* hits : {&decided.hits.point_point, &decided.hits.point_beam, &decided.hits.beam_point,
                       &decided.hits.beam_beam})
    *hits = in.real(0, std::numeric_limits<double>::max());
  CANDELA_TRY(in.done());
  return decided;
}

Result<Decision> UpbpIntegrator::decide(const UnitContext& context, const RunContext& run) const {
  CANDELA_ASSIGN(const Pilot ended, run_pilot(context, run));
  const pilot::Choice& choice = ended.choice;
  const Rules& chosen = variants_[ended.decided.variant]->rules;
  Plan plan = chosen.planned.plan;
  if (ended.radius) merging::note_radius(*ended.radius, context, plan);
  std::string found;
  for (std::size_t v = 0; v < choice.inefficiency.size(); ++v)
    found += fmt::format("{}{} {:.2g} and {:.2g}", v == 0 ? "" : "; ", variants_[v]->rules.name,
                         choice.inefficiency[v], choice.cost[v]);
  if (variants_.size() > 1)
    plan.note(setting_, fmt::format("chose {}. Error times cost over the least, and cost over that of {}, in "
                                    "a pilot: {}",
                                    chosen.name, variants_[0]->rules.name, found));
  plan.note("memory", fmt::format("an iteration of {} x {} pixels holds about {}", context.width,
                                  context.height, upbp::to_text(ended.memory)));
  return Decision{write_decision(ended.decided), std::move(plan)};
}

// The settings that vcm has too; of layers=techniques its layer `merging` is left.
SettingsMap without_media(SettingsMap settings) {
  const SettingsMap known = write_settings(VcmSettings()).map;
  std::erase_if(settings, [&](const auto& setting) { return !known.contains(setting.first); });
  const auto layers = settings.find("layers");
  if (layers != settings.end() && layers->second == "techniques") layers->second = "merging";
  return settings;
}

void say(Plan& plan, bool runs, const char* name, const char* what) {
  if (runs)
    plan.use(name, what);
  else
    plan.skip(name, "techniques leaves it out");
}

// Rules for a scene with a medium that scatters.
Rules rules_of(std::string name, const MediumRules& medium, bool connects, const PathOptions& options,
               const scene::SceneFeatures& features, bool full) {
  Techniques wanted;
  wanted.merge_medium = medium.any();
  wanted.merge_surface = medium.merge_surfaces;
  if (!connects) wanted.next_event = wanted.connect = wanted.light_image = wanted.hit_lens = false;
  Rules rules{std::move(name), vcm::plan(options, wanted, features, full), medium, false};
  Plan& plan = rules.planned.plan;
  const MediumRules& m = medium;
  say(plan, m.pp3d, "pp3d", "points of light and eye paths in balls");
  say(plan, m.pb2d, "pb2d", "points of light paths beside beams of eye paths");
  say(plan, m.bp2d, "bp2d", "beams of light paths that pass points of eye paths");
  say(plan, m.bb1d, "bb1d", "beams that pass each other");
  if (connects && m.connect_media < 1)
    plan.note(
        "connections in media",
        fmt::format("{} of the pairs of two vertices in media are connected, the rest of their light is "
                    "merged",
                    m.connect_media));
  rules.planned.between = EdgeContent::media;
  return rules;
}

// The plan if nothing is merged in media, of a list that is not the whole of vcm.
Planned planned_without_media(bool connects, bool merge_surfaces, const PathOptions& options,
                              const scene::SceneFeatures& features, bool full) {
  Techniques wanted;
  wanted.merge_medium = false;
  wanted.merge_surface = merge_surfaces;
  if (!connects) wanted.next_event = wanted.connect = wanted.light_image = wanted.hit_lens = false;
  Planned planned = vcm::plan(options, wanted, features, full);
  planned.between = EdgeContent::media;
  return planned;
}

std::string beams_of(const MediumRules& rules) {
  return fmt::format("{} beam_paths", rules.beam_paths);
}

// The set that techniques names, with few beams and, to choose from, with many.
std::vector<Rules> one_set(MediumRules medium, bool chooses_beams, bool connects, const PathOptions& options,
                           const scene::SceneFeatures& features, bool full) {
  std::vector<Rules> list = {rules_of(beams_of(medium), medium, connects, options, features, full)};
  if (chooses_beams && medium.beams()) {
    medium.beam_paths = UpbpSettings::kManyBeamPaths;
    list.push_back(rules_of(beams_of(medium), medium, connects, options, features, full));
  }
  return list;
}

// The sets that techniques=auto chooses from. chooses_beams: those with many beams are among them.
std::vector<Rules> candidates(const MediumRules& radii, bool chooses_beams, const PathOptions& options,
                              const scene::SceneFeatures& features) {
  struct Set {
    const char* name;
    bool points, beams, many;
  };
  constexpr Set kAll[] = {{"vcm", false, false, false},
                          {"vcm,pp3d,pb2d", true, false, false},
                          {"all", true, true, false},
                          {"all", true, true, true}};
  std::vector<Rules> list;
  for (const Set& set : kAll) {
    if (set.many && !chooses_beams) continue;
    MediumRules medium = radii;
    medium.pp3d = medium.pb2d = set.points;
    medium.bp2d = medium.bb1d = set.beams;
    if (set.many) medium.beam_paths = UpbpSettings::kManyBeamPaths;
    std::string name = set.name;
    if (medium.beams()) name += fmt::format(" ({})", beams_of(medium));
    list.push_back(rules_of(std::move(name), medium, true, options, features, false));
    list.back().only_if_cheap = set.many;
  }
  // Behind all sets, in their order.
  const std::size_t sets = list.size();
  for (std::size_t i = 0; i < sets; ++i) {
    if (!list[i].medium.any()) continue;
    for (const auto& [fewer, longer] : {std::pair{true, false}, {false, true}, {true, true}}) {
      if ((fewer && !(radii.connect_media > kFewConnections)) || (longer && radii.long_query_beams)) continue;
      MediumRules medium = list[i].medium;
      std::string name = list[i].name;
      if (fewer) {
        medium.connect_media = kFewConnections;
        name += fmt::format(" (connect_media {})", kFewConnections);
      }
      if (longer) {
        medium.long_query_beams = true;
        name += " (long query_beams)";
      }
      list.push_back(rules_of(std::move(name), medium, true, options, features, false));
      list.back().refined = i;
    }
  }
  return list;
}

}  // namespace

Result<std::unique_ptr<Integrator>> make_upbp_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const UpbpSettings parsed, parse_settings<UpbpSettings>(settings));
  if (parsed.techniques.has("auto") && parsed.techniques.values.size() > 1)
    return usage_error("auto chooses the techniques").with_field("techniques").with_mend("name auto alone");
  const bool full = parsed.common.full_plan(), automatic = parsed.techniques.has("auto") && !full,
             chooses_beams = parsed.beam_paths < 0 && !full;
  const bool connects = parsed.wants("vcm");
  const MediumRules medium{.pp3d = parsed.wants("pp3d"),
                           .pb2d = parsed.wants("pb2d"),
                           .bp2d = parsed.wants("bp2d"),
                           .bb1d = parsed.wants("bb1d"),
                           .radius_pp3d = parsed.radius_pp3d,
                           .radius_pb2d = parsed.radius_pb2d,
                           .radius_bp2d = parsed.radius_bp2d,
                           .radius_bb1d = parsed.radius_bb1d,
                           .beam_paths = static_cast<std::uint64_t>(
                               parsed.beam_paths < 0 ? UpbpSettings::kFewBeamPaths : parsed.beam_paths),
                           .free_paths = parsed.radius_free_paths,
                           .connect_media = parsed.connect_media,
                           .merge_surfaces = parsed.merge_surfaces,
                           .long_photon_beams = parsed.photon_beams.value == "long",
                           .long_query_beams = parsed.query_beams.value == "long"};
  const PathOptions options = parsed.common.path_options();
  const bool merges_in_media =
      features.any_scattering_medium && medium.any() && options.max_depth >= 2 && features.emitters > 0;
  if (!merges_in_media && connects && parsed.merge_surfaces)
    return make_vcm_integrator(without_media(settings), features);

  std::vector<Rules> sets;
  if (!merges_in_media)
    sets.push_back(
        {"", planned_without_media(connects, parsed.merge_surfaces, options, features, full), {}, false});
  else if (automatic)
    sets = candidates(medium, chooses_beams, options, features);
  else
    sets = one_set(medium, chooses_beams, connects, options, features, full);
  merging::MergeRules merge = parsed.merge.rules();
  merge.separate_media = true;
  std::vector<std::unique_ptr<Variant>> variants;
  for (Rules& set : sets)
    variants.push_back(std::make_unique<Variant>(std::move(set), options, merge, parsed.layers.value));
  std::unique_ptr<Integrator> made = std::make_unique<UpbpIntegrator>(
      options, std::move(variants), automatic ? "techniques=auto" : "beam_paths", merges_in_media && !full);
  return made;
}

}  // namespace candela::integrators
