#include "worker/render/renderer.h"

#include <fmt/format.h>

#include <chrono>
#include <optional>

#include "common/base/work_monitor.h"
#include "common/chains/chains.h"
#include "common/description/object_list.h"
#include "common/description/reading.h"
#include "common/description/reading_budget.h"
#include "common/description/unpacked_files.h"
#include "common/edits/edits.h"
#include "common/edits/selection.h"
#include "common/film/layers.h"
#include "common/job/tools.h"
#include "common/letters/automaton.h"
#include "common/letters/request.h"
#include "common/stages/decision.h"
#include "common/stages/epochs.h"
#include "common/stages/pixel_sums.h"
#include "worker/integrators/aov/aov_pass.h"
#include "worker/integrators/film_scale.h"
#include "worker/integrators/integrator.h"
#include "worker/integrators/parallel_tasks.h"
#include "worker/scene/bsdfs/path_edited.h"
#include "worker/scene/edits/edit_request.h"
#include "worker/scene/objects.h"
#include "worker/scene/scene.h"
#include "worker/transport/letters/path_letters.h"

namespace candela::render {
namespace {

constexpr std::uint32_t kPilotSamples = 4096;

Result<samplers::SamplerKind> sampler_kind(const std::string& name) {
  if (name == "independent") return samplers::SamplerKind::independent;
  if (name == "sobol") return samplers::SamplerKind::sobol;
  return usage_error(fmt::format("unknown sampler '{}'", name))
      .with_field("sampler")
      .with_mend("there is independent, sobol");
}

std::string features_text(const scene::SceneFeatures& f) {
  std::string text =
      fmt::format("scene: {} shapes, {} triangles, {} spheres, ", f.shapes, f.triangles, f.spheres);
  if (f.disks > 0) text += fmt::format("{} disks, ", f.disks);
  if (f.cylinders > 0) text += fmt::format("{} cylinders, ", f.cylinders);
  if (f.instances > 0) text += fmt::format("{} instances, ", f.instances);
  text += fmt::format("{} textures, {} emitters\n", f.textures, f.emitters);
  const auto list = [&](std::string_view title, const std::map<std::string, std::uint32_t>& kinds) {
    text += fmt::format("{}:", title);
    for (const auto& [kind, count] : kinds) text += fmt::format(" {} x{}", kind, count);
    if (kinds.empty()) text += " none";
    text += '\n';
  };
  list("bsdfs", f.bsdf_kinds);
  list("emitters", f.emitter_kinds);
  for (const std::string& edit : f.edits) text += edit + '\n';
  if (f.media > 0)
    text += fmt::format("media: {}{}{}\n", f.media, f.any_heterogeneous_medium ? ", not all homogeneous" : "",
                        f.endless_medium ? "; the outer one has no end: no light from outside" : "");
  return text;
}

// The integrator's work with what AOVs ask for beside it.
WorkPlan with_aovs(WorkPlan work, const integrators::AovPass& aovs, const scene::SceneFeatures& features,
                   const scene::SceneObjects& objects) {
  for (film::AccumulatorSpec& spec : aovs.accumulators(features, objects))
    work.accumulators.push_back(std::move(spec));
  return work;
}

// The layers by light path expressions that the job asks for, with those of the scene's lamps, if it asks for
// them. Lamps that are black have one, too: the client knows all lamps of the description.
Result<letters::LayerRequest> layer_request(const std::string& text,
                                            const description::LetterObjects& objects) {
  CANDELA_ASSIGN(letters::LayerRequest request, letters::parse_layer_request(text));
  return letters::expand_light_groups(std::move(request), objects.lamp_names);
}

// The automaton for the objects that the scene has built. An expression may name what was left out.
Result<letters::Automaton> automaton_of(const letters::LayerRequest& layers, const scene::SceneObjects& built,
                                        const description::LetterObjects& described) {
  std::vector<letters::ObjectNames> names = built.names;
  std::vector<std::uint8_t> uses = built.uses;
  names.insert(names.end(), described.names.begin(), described.names.end());
  uses.insert(uses.end(), described.uses.begin(), described.uses.end());
  return letters::Automaton::compile(layers, names, uses);
}

// Fails (usage) if a layer of a job of chains has the name of another one's second part.
Result<void> check_parts(const letters::LayerRequest& request, const WorkPlan& work) {
  for (const letters::NamedExpression& layer : request.layers)
    if (work.chains && layer.name.ends_with(chains::kIndependentPart))
      return usage_error(fmt::format("the layer '{}' of a job of chains ends as second parts of layers do",
                                     layer.name))
          .with_field("layers")
          .with_mend("give it another name");
  return {};
}

// Edits that select by more of the path than the vertex, beside layers.
Result<void> check_path_edits(const scene::Scene& scene, const JobSettings& settings) {
  const scene::PathEdits* const edits = scene.objects().path_edits.get();
  if (edits == nullptr || edits->mixed.empty() || settings.layers.empty()) return {};
  return edits::letters_not_known(edits->mixed);
}

// Adds to the integrator's work the layers of expressions: of chains one for the part of each that the chains
// bring, then one for the rest (common/chains/chains.h).
WorkPlan with_layers(WorkPlan work, const letters::LayerRequest& request) {
  for (const letters::NamedExpression& layer : request.layers) work.layers.push_back(layer.name);
  if (work.chains)
    for (const letters::NamedExpression& layer : request.layers)
      work.layers.push_back(layer.name + std::string(chains::kIndependentPart));
  return work;
}

// Fails (usage) if an AOV has the name of a layer.
Result<void> check_names(const std::vector<Aov>& aovs, const std::vector<std::string>& layers) {
  for (const Aov& aov : aovs)
    for (const std::string& name : layer_names(aov))
      if (std::find(layers.begin(), layers.end(), name) != layers.end())
        return usage_error(fmt::format("an AOV is called '{}' as a layer of the integrator is", name))
            .with_field("aovs")
            .with_mend("give it another name: NAME:KIND");
  return {};
}

// Result of `work`; "stopped" if it was stopped on the way.
template <class Work>
auto unless_stopped(const Work& work) -> decltype(work()) {
  try {
    return work();
  } catch (const WorkStopped&) {
    return integrators::stopped_error();
  }
}

class SceneRenderer final : public Renderer {
 public:
  SceneRenderer(JobSettings settings, std::unique_ptr<scene::Scene> scene,
                std::unique_ptr<scene::Scene> parameterized_scene,
                std::unique_ptr<integrators::Integrator> integrator, integrators::AovPass aovs,
                film::PixelFilter filter, samplers::SamplerKind sampler, WorkPlan work, film::Layout layout,
                letters::LayerRequest layers, std::unique_ptr<transport::PathLetters> path_letters)
      : settings_(std::move(settings)),
        scene_(std::move(scene)),
        parameterized_scene_(std::move(parameterized_scene)),
        integrator_(std::move(integrator)),
        aovs_(std::move(aovs)),
        filter_(std::move(filter)),
        sampler_(sampler),
        work_(std::move(work)),
        layout_(layout),
        layers_(std::move(layers)),
        path_letters_(std::move(path_letters)) {
    if (work_.epochs) epochs_.emplace(work_.epochs->first, work_.epochs->growth);
  }

  UnitOutput make_output(const NamedState& state) const override {
    UnitOutput output;
    output.film = std::make_unique<film::UnitFilm>(layout_, state.film_scale_log2);
    const auto make = [&](const film::AccumulatorSpec& spec) {
      return std::make_unique<film::UnitAccumulator>(layout_.width, layout_.height, spec);
    };
    for (const film::AccumulatorSpec& spec : integrators_work(state).accumulators)
      output.accumulators.push_back(make(spec));
    for (const film::AccumulatorSpec& spec : aovs_.accumulators(scene_->features(), scene_->objects()))
      output.aovs.push_back(make(spec));
    return output;
  }

  Result<PilotResult> pilot(const RunContext& run_context) const override {
    return unless_stopped([&] { return run_pilot(run_context); });
  }

  Result<void> run(const Unit& unit, const UnitInput& input, UnitOutput& output,
                   const RunContext& run_context) const override {
    return unless_stopped([&]() -> Result<void> {
      CANDELA_TRY(check(unit, input, output));
      output.epoch = epochs_ ? epochs_->of_index(unit.begin) : 0;
      CANDELA_TRY(integrator_->run(context(), unit, input, output, run_context));
      CANDELA_TRY(aovs_.run(aov_context(), unit, output, run_context));
      if (output.overflowed()) return failed_error("a sum of this unit overflowed 64 bits");
      if (output.overfull())
        return input_error(
                   "the mattes of this unit have more pairs of pixel and name than there is memory for")
            .with_field("aovs")
            .with_mend("leave mattes out, or give small objects one id together");
      return {};
    });
  }

  Result<std::string> plan_text() const override {
    return unless_stopped([&]() -> Result<std::string> {
      CANDELA_ASSIGN(integrators::Decision decision, integrator_->decide(context(), {}));
      CANDELA_TRY(work({0, 0, std::move(decision.bytes)}));
      return text_of(decision.plan);
    });
  }

  const scene::SceneFeatures* features() const override { return &scene_->features(); }

 private:
  Result<PilotResult> run_pilot(const RunContext& run_context) const {
    CANDELA_ASSIGN(integrators::Decision decision, integrator_->decide(context(), run_context));
    if (decision.bytes.size() > Limits::max_decided_bytes)
      return internal_error(fmt::format("the pilot decided {} bytes", decision.bytes.size()));
    const auto begin = std::chrono::steady_clock::now();
    const std::vector<float> luminances = integrator_->pilot_luminances(context(), kPilotSamples);
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;

    PilotResult result;
    result.state.film_scale_log2 =
        integrators::film_scale_log2(luminances, scene_->features().max_emitted_radiance);
    result.state.decided = std::move(decision.bytes);
    result.plan = text_of(decision.plan);
    CANDELA_ASSIGN(result.work, work(result.state));
    const double pixels = static_cast<double>(settings_.width) * settings_.height;
    result.seconds_per_iteration =
        seconds.count() * pixels / kPilotSamples / std::max(1U, run_context.threads);
    if (!work_.chains) return result;

    // For chains: seconds of a segment, from the minimum cost of a mutation, that of an independent sample.
    RunContext quiet = run_context;
    quiet.threads = 1;
    quiet.progress = nullptr;
    const std::uint64_t samples = std::min<std::uint64_t>(256, work_.chains->bootstrap_samples);
    UnitOutput discarded;
    const auto timed = std::chrono::steady_clock::now();
    CANDELA_TRY(integrator_->run(context(), {Unit::Kind::bootstrap, 0, 0, samples}, {result.state, {}, {}},
                                 discarded, quiet));
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - timed;
    result.seconds_per_iteration = spent.count() / static_cast<double>(samples) *
                                   static_cast<double>(work_.chains->segment_mutations) /
                                   std::max(1U, run_context.threads);
    return result;
  }

  // A unit of the kinds that the plan has, with the input and output of its kind.
  Result<void> check(const Unit& unit, const UnitInput& input, const UnitOutput& output) const {
    const std::uint64_t count = unit.end - unit.begin;
    bool possible =
        unit.half <= 1 && unit.begin < unit.end && makes_film(unit.kind) == (output.film != nullptr);
    switch (unit.kind) {
      case Unit::Kind::pilot:
        return internal_error("a pilot is not run as a unit");
      case Unit::Kind::iterations:
        possible &= !work_.chains && input.starts.empty();
        if (epochs_) possible &= epochs_->of_index(unit.begin) == epochs_->of_index(unit.end - 1);
        break;
      case Unit::Kind::bootstrap:
        possible &= work_.chains && unit.end <= chains::kMaxBootstrapSamples && input.starts.empty();
        break;
      case Unit::Kind::segments:
        possible &= work_.chains && count <= work_.chains->chains / 2 && input.starts.size() == count;
        break;
    }
    return possible ? Result<void>() : internal_error("not a unit of this job");
  }

  WorkPlan integrators_work(const NamedState& state) const {
    return integrator_->work({settings_.width, settings_.height}, state);
  }
  Result<WorkPlan> work(const NamedState& state) const {
    WorkPlan work = with_aovs(with_layers(integrators_work(state), layers_), aovs_, scene_->features(),
                              scene_->objects());
    auto valid = validate(work, settings_.width, settings_.height);
    if (valid.ok()) return work;
    if (work.accumulators.size() <= film::kMaxAccumulators) return valid.error();
    return Error(valid.error()).with_mend("fewer AOVs, or light_groups=infinite or one");
  }
  std::string text_of(const integrators::Plan& plan) const {
    return features_text(scene_->features()) + fmt::format("integrator: {}\n", settings_.integrator) +
           plan.to_text() + aovs_.plan_text();
  }
  integrators::UnitContext context() const {
    return {*scene_,         filter_,          sampler_, settings_.seed,
            settings_.width, settings_.height, {1, 1},   path_letters_.get()};
  }
  integrators::UnitContext aov_context() const {
    return {parameterized_scene_ ? *parameterized_scene_ : *scene_,
            filter_,
            sampler_,
            settings_.seed,
            settings_.width,
            settings_.height};
  }

  JobSettings settings_;
  std::unique_ptr<scene::Scene> scene_;
  std::unique_ptr<scene::Scene> parameterized_scene_;  // null: no AOV needs one
  std::unique_ptr<integrators::Integrator> integrator_;
  integrators::AovPass aovs_;
  film::PixelFilter filter_;
  samplers::SamplerKind sampler_;
  WorkPlan work_;  // the integrator's before the pilot: layers and stages are decided by then
  std::optional<Epochs> epochs_;
  film::Layout layout_;
  letters::LayerRequest layers_;                          // with those of lamps
  std::unique_ptr<transport::PathLetters> path_letters_;  // null: no layers by expressions
};

Result<std::unique_ptr<Renderer>> compile(const description::FileSource& files, const std::string& main_key,
                                          const std::map<std::string, std::string>& parameters,
                                          const JobSettings& settings, unsigned threads,
                                          const scene::TextureLimits& textures, std::uint64_t memory_bytes,
                                          bool traced) {
  CANDELA_ASSIGN(const integrators::IntegratorEntry* entry,
                 integrators::find_integrator(settings.integrator));
  CANDELA_ASSIGN(const samplers::SamplerKind sampler, sampler_kind(settings.sampler));
  CANDELA_ASSIGN(film::PixelFilter filter,
                 film::PixelFilter::create(settings.filter, settings.filter_settings));
  work_phase(WorkPhase::reading);
  description::ReadingBudget budget(memory_bytes);
  const description::BudgetedFiles counted(files, budget);
  // The client has refused what it should or told of it; what has come here is rendered.
  CANDELA_ASSIGN(const description::ReadScene scene_file,
                 description::read_scene(counted, main_key, parameters,
                                         {.integrator = settings.integrator, .lenient = true}));
  const description::UnpackedFiles unpacked(counted);
  const description::SceneDescription& description = scene_file.description;
  scene::Scene::Options options;
  options.isa = settings.isa;
  options.build_threads = threads;
  const tools::CameraFilm camera = tools::camera_film(settings);
  options.film_width = camera.width;
  options.film_height = camera.height;
  options.crop = camera.crop;
  options.textures = textures;
  options.traced = traced;
  description::LetterObjects described;
  if (!settings.layers.empty() || !settings.edits.empty())
    described = description::letter_objects(*description.scene);
  scene::EditRequest edits;
  CANDELA_ASSIGN(edits.list, edits::parse_edits(settings.edits));
  CANDELA_TRY(edits::check_integrator(edits.list, settings.integrator,
                                      edits::max_depth_of(settings.integrator_settings)));
  CANDELA_TRY(description::check_edits(edits.list, *description.scene));
  edits.names = described.names;
  edits.uses = described.uses;
  options.edits = &edits;
  CANDELA_ASSIGN(std::vector<Aov> aov_list, parse_aovs(settings.aovs));
  const bool mattes =
      std::any_of(aov_list.begin(), aov_list.end(), [](const Aov& aov) { return is_matte(aov.kind); });
  options.named = mattes || !settings.layers.empty() || tools::records_paths(settings.integrator);
  work_phase(WorkPhase::building);
  CANDELA_ASSIGN(std::unique_ptr<scene::Scene> scene, scene::Scene::build(description, unpacked, options));
  CANDELA_TRY(check_path_edits(*scene, settings));
  CANDELA_ASSIGN(letters::LayerRequest layers, layer_request(settings.layers, described));
  scene::SceneFeatures features = scene->features();
  features.reads_letters = !layers.empty();
  CANDELA_ASSIGN(std::unique_ptr<integrators::Integrator> integrator,
                 entry->create(settings.integrator_settings, features));
  WorkPlan work = integrator->work({settings.width, settings.height}, {});
  std::unique_ptr<transport::PathLetters> path_letters;
  if (!layers.empty()) {
    CANDELA_TRY(check_parts(layers, work));
    CANDELA_ASSIGN(letters::Automaton automaton, automaton_of(layers, scene->objects(), described));
    path_letters = std::make_unique<transport::PathLetters>(
        std::move(automaton), layers, *scene, 1 + static_cast<std::uint32_t>(work.layers.size()));
  }
  work = with_layers(std::move(work), layers);
  CANDELA_TRY(check_names(aov_list, work.layers));
  integrators::AovPass aovs(std::move(aov_list), work.chains);
  std::unique_ptr<scene::Scene> parameterized_scene;
  if (aovs.reads_parameters()) {
    options.parameterized = true;
    CANDELA_ASSIGN(parameterized_scene, scene::Scene::build(description, unpacked, options));
  }
  CANDELA_ASSIGN(const film::Layout layout, film::make_layout(settings.width, settings.height, work.layers));
  return std::unique_ptr<Renderer>(std::make_unique<SceneRenderer>(
      settings, std::move(scene), std::move(parameterized_scene), std::move(integrator), std::move(aovs),
      std::move(filter), sampler, std::move(work), layout, std::move(layers), std::move(path_letters)));
}

}  // namespace

Result<std::unique_ptr<Renderer>> Renderer::create(const description::FileSource& files,
                                                   const std::string& main_key,
                                                   const std::map<std::string, std::string>& parameters,
                                                   const JobSettings& settings, unsigned threads,
                                                   const scene::TextureLimits& textures,
                                                   std::uint64_t memory_bytes) {
  return unless_stopped(
      [&] { return compile(files, main_key, parameters, settings, threads, textures, memory_bytes, true); });
}

Result<scene::SceneFeatures> check_scene(const description::FileSource& files, const std::string& main_key,
                                         const std::map<std::string, std::string>& parameters,
                                         const JobSettings& settings, unsigned threads,
                                         std::uint64_t memory_bytes) {
  CANDELA_ASSIGN(const auto renderer, unless_stopped([&] {
                   return compile(files, main_key, parameters, settings, threads, {}, memory_bytes, false);
                 }));
  return *renderer->features();
}

std::vector<std::string> supported_isas() {
  std::vector<std::string> isas = {"sse2"};
  if (__builtin_cpu_supports("sse4.2")) isas.emplace_back("sse4.2");
  if (__builtin_cpu_supports("avx")) isas.emplace_back("avx");
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2"))
    isas.emplace_back("avx2");
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512vl"))
    isas.emplace_back("avx512");
  return isas;
}

std::vector<std::string> integrator_names() {
  std::vector<std::string> names;
  for (const auto& entry : integrators::registry()) names.emplace_back(entry.name);
  return names;
}

Result<std::vector<SettingDoc>> integrator_settings(const std::string& integrator) {
  CANDELA_ASSIGN(const integrators::IntegratorEntry* entry, integrators::find_integrator(integrator));
  return entry->document();
}

Result<SettingsMap> complete_integrator_settings(const std::string& integrator, const SettingsMap& from_scene,
                                                 const SettingsMap& from_user) {
  CANDELA_ASSIGN(const integrators::IntegratorEntry* entry, integrators::find_integrator(integrator));
  SettingsMap merged = from_scene;
  for (const auto& [name, value] : from_user) merged[name] = value;
  return entry->complete(merged);
}

Result<WorkPlan> largest_work(const JobSettings& settings) {
  CANDELA_ASSIGN(const integrators::IntegratorEntry* entry,
                 integrators::find_integrator(settings.integrator));
  CANDELA_ASSIGN(const std::vector<Aov> aovs, parse_aovs(settings.aovs));
  CANDELA_ASSIGN(const letters::LayerRequest layers, letters::parse_layer_request(settings.layers));
  // A scene for which nothing is skipped; what a plan drops because of fog or masks is not in it. Settings
  // that it has no use for may suit a scene of lamps alone.
  scene::SceneFeatures lamps;
  lamps.shapes = lamps.emitters = 2;
  lamps.bsdf_kinds["diffuse"] = 1;
  lamps.any_area_emitter = lamps.any_mesh_emitter = lamps.any_rectangle_emitter = true;
  lamps.radius = 1;
  scene::SceneFeatures everything = lamps;
  everything.any_delta_emitter = everything.any_environment = true;
  // More groups of lights than the scene has: too large an estimate is settled by the scene itself.
  if (const auto groups = settings.integrator_settings.find("light_groups");
      groups != settings.integrator_settings.end() && groups->second != "one") {
    lamps.emitters = everything.emitters = pixel_sums::kMaxGroups;
    everything.environments = everything.infinite_emitters = 1;
  }
  // As many names as mattes have memory for in the mean of a pixel.
  scene::SceneObjects objects;
  objects.object_mattes.names = objects.material_mattes.names =
      std::vector<std::string>(film::kMaxPixelKeys, "name");
  std::optional<WorkPlan> largest;
  std::optional<Error> error;
  for (const bool full : {false, true})
    for (const scene::SceneFeatures& features : {everything, lamps}) {
      SettingsMap chosen = settings.integrator_settings;
      if (full && chosen.contains("plan")) chosen["plan"] = "full";
      const auto integrator = entry->create(chosen, features);
      if (!integrator.ok()) {
        if (!error) error = integrator.error();
        continue;
      }
      WorkPlan work = with_layers((*integrator)->work({settings.width, settings.height}, {}), layers);
      const integrators::AovPass pass(aovs, work.chains);
      work = with_aovs(std::move(work), pass, features, objects);
      if (!largest || statistics_bytes(work, settings.width, settings.height) >
                          statistics_bytes(*largest, settings.width, settings.height))
        largest = std::move(work);
    }
  if (!largest) return *error;
  return *std::move(largest);
}

Result<SettingsMap> integrator_settings_of_effort(const std::string& integrator, const Effort& effort) {
  CANDELA_ASSIGN(const integrators::IntegratorEntry* entry, integrators::find_integrator(integrator));
  return entry->of_effort(effort);
}

Result<std::uint64_t> samples_per_iteration(const std::string& integrator, const SettingsMap& settings) {
  CANDELA_ASSIGN(const integrators::IntegratorEntry* entry, integrators::find_integrator(integrator));
  return entry->samples_per_iteration(settings);
}

}  // namespace candela::render
