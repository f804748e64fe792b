#include "client/settings.h"

#include <fmt/format.h>

#include <algorithm>

#include "client/values.h"
#include "common/base/config.h"
#include "common/base/files.h"
#include "common/base/quantity.h"
#include "common/description/all_errors.h"
#include "common/description/film_window.h"
#include "common/description/mutation_flags.h"
#include "common/description/object_list.h"
#include "common/description/scene_aovs.h"
#include "common/description/setting_text.h"
#include "common/description/vocabulary.h"
#include "common/edits/edits.h"
#include "common/job/aov.h"
#include "common/job/setting_names.h"
#include "common/letters/request.h"

namespace candela::client {
namespace {

using description::Object;
using description::ObjectPtr;

// Mitsuba's defaults for what a scene does not say.
constexpr std::int64_t kDefaultSampleCount = 4;

Error scene_error(const Object& object, std::string message) {
  return input_error(std::move(message)).at(object.where.file, object.where.line);
}

ObjectPtr first_child(const Object* parent, std::string_view category) {
  if (parent == nullptr) return nullptr;
  const auto children = parent->children_of(category);
  return children.empty() ? nullptr : children.front();
}

// The parameters of the scene's integrator that count for the one that runs.
description::Note passed_over(const Object& written, const std::string& runs, const SettingsMap& kept) {
  std::vector<std::string> values;
  for (const auto& [name, value] : kept) values.push_back(fmt::format("{} = {}", name, printable(value)));
  return {written.where, fmt::format("the scene asks for the integrator '{}', the command line for '{}'; {}",
                                     printable(written.plugin), runs,
                                     values.empty() ? "nothing of the scene's counts"
                                                    : "of the scene's counts " + join(values, ", "))};
}

// The property of a scene's integrator that counts under every integrator: the renderer reads it there.
constexpr std::string_view kOfScene = "strict_normals";

// The setting that a flag of mutations stands for; empty: it is none.
std::string_view setting_of_flag(std::string_view integrator, std::string_view name) {
  if (integrator != "mlt" && integrator != "erpt") return {};
  for (const description::MutationFlag& flag : description::kMutationFlags)
    if (flag.name == name) return flag.setting;
  return {};
}

// Null: the vocabulary has no such parameter.
const description::PropertyRule* rule_of(const Object& integrator, const std::string& name) {
  const description::PluginRule* plugin = description::find_plugin("integrator", integrator.plugin);
  if (plugin == nullptr) return nullptr;
  const auto rule = std::find_if(plugin->properties.begin(), plugin->properties.end(),
                                 [&](const description::PropertyRule& r) { return r.name == name; });
  return rule == plugin->properties.end() ? nullptr : &*rule;
}

// The film's size and the job's limits are resolved.
Result<void> resolve_integrator(const Object& scene, const SceneOptions& options, const RendererFacts& facts,
                                PreparedJob& job) {
  JobSettings& settings = job.settings;
  const std::vector<std::string> names = facts.integrator_names();
  const std::vector<std::string_view> known(names.begin(), names.end());
  const ObjectPtr written = first_child(&scene, "integrator");
  const std::filesystem::path file(options.scene);
  const bool is_old = written == nullptr && description::is_old_scene(bundle::DiskSource(file.parent_path()),
                                                                      file.filename().string());
  if (options.integrator) {
    CANDELA_ASSIGN(settings.integrator, parse_choice(*options.integrator, "--integrator", known));
  } else if (written == nullptr) {
    settings.integrator = "path";
    job.default_integrator = description::Note{
        scene.where,
        is_old ? "the scene has no integrator: 'direct' runs, path tracing with max_depth = 2, as in "
                 "Mitsuba 0.6"
               : "the scene has no integrator: 'path' runs, as in Mitsuba"};
  } else if (std::find(names.begin(), names.end(), written->plugin) == names.end()) {
    return scene_error(*written, fmt::format("there is no integrator '{}' here", printable(written->plugin)))
        .with_mend(fmt::format("give --integrator, one of {}", join(names, ", ")));
  } else {
    settings.integrator = written->plugin;
  }

  CANDELA_ASSIGN(const SettingsMap from_user, parse_assignments(options.sets, "--set"));
  const auto preset = from_user.find("preset");
  // The presets that leave shares to settings.
  const bool presets = preset != from_user.end() && preset->second != "none" && preset->second != "erpt";
  SettingsMap from_scene, of_scene;
  if (job.default_integrator && is_old) from_scene["max_depth"] = "2";
  const bool own = written != nullptr && written->plugin == settings.integrator;
  if (written != nullptr) {
    // Under another integrator than the scene's own, what both know by one name carries over (max_depth,
    // say).
    CANDELA_ASSIGN(const std::vector<std::string> settable, facts.setting_names(settings.integrator));
    for (const description::Property& property : written->properties) {
      if (const std::string_view share = setting_of_flag(written->plugin, property.name); !share.empty()) {
        // A preset of the command line has shares of its own.
        const auto* on = std::get_if<bool>(&property.value);
        if (own && on != nullptr && !presets) from_scene[std::string(share)] = *on ? "1" : "0";
        continue;
      }
      const bool can_be_set = std::find(settable.begin(), settable.end(), property.name) != settable.end();
      const description::PropertyRule* rule = rule_of(*written, property.name);
      // Mitsuba's parameter is not a setting of the same name here, which may have another meaning.
      if (rule != nullptr && rule->ignored) continue;
      if (!can_be_set && property.name != kOfScene && (!own || (rule != nullptr && !rule->only.empty())))
        continue;
      const auto text = setting_text(property);
      if (!text)
        return input_error(fmt::format("'{}' cannot be a setting of an integrator", property.name))
            .at(property.where.file, property.where.line);
      (property.name == kOfScene ? of_scene : from_scene)[property.name] = *text;
    }
  }
  const auto try_complete = [&] {
    SettingsMap given = job.of_effort;
    given.insert(from_scene.begin(), from_scene.end());
    return facts.complete_settings(settings.integrator, given, from_user);
  };
  std::uint64_t samples_per_iteration = 1;
  if (const auto given = try_complete(); given.ok()) {
    CANDELA_ASSIGN(samples_per_iteration, facts.samples_per_iteration(settings.integrator, *given));
  }
  CANDELA_ASSIGN(
      job.of_effort,
      facts.settings_of_effort(settings.integrator,
                               effort_of(job.spp, job.stop, std::uint64_t{settings.width} * settings.height,
                                         samples_per_iteration)));
  std::erase_if(job.of_effort, [&](const auto& setting) {
    return from_scene.contains(setting.first) || from_user.contains(setting.first);
  });
  auto complete = try_complete();
  // A value of another integrator that this one cannot have does not count.
  while (!complete && !own && !from_user.contains(complete.error().field) &&
         from_scene.erase(complete.error().field) > 0)
    complete = try_complete();
  if (written != nullptr && !own) {
    of_scene.insert(from_scene.begin(), from_scene.end());
    job.other_integrator = passed_over(*written, settings.integrator, of_scene);
  }
  if (!complete) {
    // The validator names the setting; we know where it was written.
    Error error = std::move(complete).error();
    if (from_user.contains(error.field)) {
      error.field = "--set " + error.field;
    } else if (written != nullptr && error.file.empty()) {
      const description::Property* property = written->find(error.field);
      const description::Location& where = property != nullptr ? property->where : written->where;
      error.kind = ErrorKind::input;
      error.file = where.file;
      error.line = where.line;
    }
    return error;
  }
  settings.integrator_settings = std::move(complete).value();
  return {};
}

Result<std::uint64_t> parse_spp(const std::string& text) {
  return parse_count(text, "--spp", 1, Limits::max_iterations);
}

Result<void> resolve_filter(const Object* film, const SceneOptions& options, JobSettings& settings) {
  const ObjectPtr written = first_child(film, "rfilter");
  if (options.filter) {
    CANDELA_ASSIGN(settings.filter, parse_choice(*options.filter, "--filter", kFilterNames));
  } else if (written == nullptr) {
    settings.filter = "gaussian";
  } else if (std::find(kFilterNames.begin(), kFilterNames.end(), written->plugin) == kFilterNames.end()) {
    return scene_error(*written, fmt::format("there is no rfilter '{}' here", printable(written->plugin)))
        .with_mend(fmt::format("give --filter, one of {}", join(kFilterNames, ", ")));
  } else {
    settings.filter = written->plugin;
  }
  // The scene's numbers mean nothing for another filter than the scene's.
  const Object* given = written != nullptr && written->plugin == settings.filter ? written.get() : nullptr;
  settings.filter_settings.clear();
  const auto take = [&](const std::string& name, double otherwise, double least,
                        double most) -> Result<void> {
    const double value = given != nullptr ? given->get_number(name, otherwise) : otherwise;
    if (!(value >= least) || !(value <= most))
      return scene_error(*written, fmt::format("{} is {}, not within {} and {}", name, value, least, most));
    settings.filter_settings[name] = fmt::format("{}", value);
    return {};
  };
  constexpr double kSmallestRadius = 1e-6, kLargestRadius = 64;  // pixels
  if (settings.filter == "gaussian") return take("stddev", 0.5, kSmallestRadius, kLargestRadius);
  if (settings.filter == "box") return take("radius", 0.5, kSmallestRadius, kLargestRadius);
  if (settings.filter == "tent") return take("radius", 1.0, kSmallestRadius, kLargestRadius);
  if (settings.filter == "lanczos") {
    const std::int64_t lobes = given != nullptr ? given->get_integer("lobes", 3) : 3;
    if (lobes < 1 || lobes > 32)
      return scene_error(*written, fmt::format("lobes is {}, not within 1 and 32", lobes));
    settings.filter_settings["lobes"] = fmt::format("{}", lobes);
  }
  if (settings.filter == "mitchell") {
    CANDELA_TRY(take("B", 1.0 / 3, -8, 8));
    CANDELA_TRY(take("C", 1.0 / 3, -8, 8));
  }
  return {};
}

Result<void> resolve_size(const Object* film, const SceneOptions& options, JobSettings& settings) {
  Size size;
  if (options.size) {
    CANDELA_ASSIGN(size, parse_size(*options.size, "--size"));
  } else {
    const description::FilmWindow window =
        film != nullptr ? description::film_window(*film) : description::FilmWindow();
    auto parsed = parse_size(fmt::format("{}x{}", window.width, window.height), "film size");
    if (!parsed) {
      Error error = std::move(parsed).error();
      error.kind = ErrorKind::input;
      if (film != nullptr) return std::move(error).at(film->where.file, film->where.line);
      return error;
    }
    size = *parsed;
  }
  settings.width = size.width;
  settings.height = size.height;
  if (!options.crop) return {};
  CANDELA_ASSIGN(const CropWindow crop, parse_crop(*options.crop, "--crop"));
  const auto fits = [](std::uint64_t begin, std::uint64_t extent, std::uint32_t whole) {
    return begin + extent <= whole;
  };
  if (!fits(crop.x, crop.width, size.width) || !fits(crop.y, crop.height, size.height))
    return usage_error(fmt::format("{} x {} pixels at {}, {} are not within the image's {} x {}", crop.width,
                                   crop.height, crop.x, crop.y, size.width, size.height))
        .with_field("--crop")
        .with_mend("give left, top, width and height in pixels of the whole image");
  settings.crop = Crop{crop.x, crop.y, size.width, size.height};
  settings.width = crop.width;
  settings.height = crop.height;
  return {};
}

// Returns the effort in samples a pixel: --spp, or the scene's where no limit is given; else 0.
Result<std::uint64_t> resolve_sampling(const Object* sampler, const SceneOptions& options, PreparedJob& job) {
  JobSettings& settings = job.settings;
  CANDELA_TRY(set_if_given(settings.sampler, options.sampler, "--sampler", parse_choice, kSamplerNames));
  CANDELA_TRY(set_if_given(settings.isa, options.isa, "--isa", parse_choice, kIsaNames));
  if (options.seed) {
    CANDELA_ASSIGN(settings.seed, parse_count(*options.seed, "--seed", 0, UINT64_MAX));
  } else if (sampler != nullptr) {
    const std::int64_t seed = sampler->get_integer("seed", 0);
    if (seed < 0) return scene_error(*sampler, fmt::format("seed is {}, below 0", seed));
    settings.seed = static_cast<std::uint64_t>(seed);
  }
  CANDELA_ASSIGN(job.stop, parse_stop(options));
  CANDELA_ASSIGN(job.indices, parse_exact_indices(options));
  job.stop_given = options.spp || options.iterations || options.time || options.until || options.indices;
  if (options.spp) return parse_spp(*options.spp);
  if (job.stop_given) return 0;
  const std::int64_t count =
      sampler != nullptr ? sampler->get_integer("sample_count", kDefaultSampleCount) : kDefaultSampleCount;
  if (count < 1 || static_cast<std::uint64_t>(count) > Limits::max_iterations)
    return scene_error(*sampler,
                       fmt::format("sample_count is {}, not within 1 and {}", count, Limits::max_iterations));
  return static_cast<std::uint64_t>(count);
}

// As the job has it: --aov, or what the scene asks for.
Result<std::string> resolve_aovs(const std::string& of_scene, const SceneOptions& options) {
  if (!options.aov) return of_scene;
  auto aovs = parse_aovs(*options.aov);
  if (!aovs) return std::move(aovs).error().with_field("--aov");
  return text_of(*aovs);
}

// The layers of light path expressions that the options ask for.
Result<letters::LayerRequest> parse_layers(const SceneOptions& options) {
  letters::LayerRequest request;
  const bool none = options.layers == std::vector<std::string>{"none"};
  for (const std::string& text : options.layers)
    if (auto added = letters::add_layers(text, request); !none && !added.ok())
      return std::move(added).error().with_field("--layer");
  for (const std::string& text : options.regions) {
    auto region = letters::parse_region(text);
    if (!region) return std::move(region).error().with_field("--region");
    request.regions.push_back(*std::move(region));
  }
  if (options.glossy_below) {
    auto glossy_below = letters::parse_glossy_below(*options.glossy_below);
    if (!glossy_below) return std::move(glossy_below).error().with_field("--glossy-below");
    request.glossy_below = *glossy_below;
  }
  request.light_groups |= options.light_groups;
  request.partition |= options.partition;
  return request;
}

// As the job has it: what the options ask for if they name layers; else the scene's layers, with the regions
// and the flags of the options. The expressions are compiled with the names of the scene's objects.
Result<std::string> resolve_layers(const description::SceneDescription& scene, const SceneOptions& options) {
  CANDELA_ASSIGN(letters::LayerRequest request, parse_layers(options));
  const bool replaces = !options.layers.empty() || options.light_groups;
  if (!replaces && !scene.layers.empty()) {
    CANDELA_ASSIGN(letters::LayerRequest written, letters::parse_layer_request(scene.layers));
    std::move(request.regions.begin(), request.regions.end(), std::back_inserter(written.regions));
    if (options.glossy_below) written.glossy_below = request.glossy_below;
    written.partition |= request.partition;
    request = std::move(written);
  }
  auto checked = description::check_layers(request, *scene.scene);
  if (!checked) return std::move(checked).error().with_field(replaces ? "--layer" : "");
  std::string text = letters::text_of(request);
  if (text.size() > letters::kMaxRequestBytes)
    return usage_error(fmt::format("the layers have {} bytes of text, more than {}", text.size(),
                                   letters::kMaxRequestBytes))
        .with_field("--layer");
  return text;
}

// The edits' text, from a file or as it is.
Result<edits::EditList> read_edits(const SceneOptions& options) {
  if (!options.edits || *options.edits == "none") return edits::EditList{};
  const bool is_text = options.edits->starts_with('{');
  std::string text = *options.edits;
  if (!is_text) {
    auto bytes = read_file(*options.edits, edits::kMaxEditsBytes);
    if (!bytes.ok()) return std::move(bytes).error().with_field("--edits");
    text = *std::move(bytes);
    if (text.empty())
      return input_error("the file is empty")
          .at(*options.edits, 0)
          .with_mend(R"(write {"edits": [ {...} ]})");
  }
  auto list = edits::parse_edits(text);
  if (list.ok()) return list;
  Error error = std::move(list).error();
  if (!error.field.empty()) error.message = fmt::format("{}: {}", error.field, error.message);
  return is_text ? std::move(error).with_field("--edits")
                 : std::move(error).with_field("").at(*options.edits, 0);
}

// As the job has them. Their expressions are compiled with the names of the scene's objects. The integrator
// is resolved.
Result<std::string> resolve_edits(const description::SceneDescription& scene, const SceneOptions& options,
                                  const JobSettings& settings) {
  CANDELA_ASSIGN(edits::EditList list, read_edits(options));
  if (!options.edits) {
    CANDELA_ASSIGN(list, edits::parse_edits(scene.scene->get_string(description::kEditsOfScene, "")));
  }
  const auto field = [&](auto checked) -> Result<void> {
    if (checked.ok()) return {};
    return std::move(checked).error().with_field(options.edits ? "--edits" : "edits of the scene");
  };
  CANDELA_TRY(field(
      edits::check_integrator(list, settings.integrator, edits::max_depth_of(settings.integrator_settings))));
  CANDELA_TRY(field(description::check_edits(list, *scene.scene)));
  return edits::text_of(list);
}

}  // namespace

Result<StopRule> parse_stop(const SceneOptions& options) {
  StopRule stop;
  if (options.spp) CANDELA_TRY(parse_spp(*options.spp));
  if (options.spp && options.iterations)
    return usage_error("--spp and --iterations exclude each other")
        .with_mend("give samples per pixel by --spp; --iterations counts passes, of Markov chains rounds");
  CANDELA_TRY(set_if_given(stop.iterations, options.iterations, "--iterations", parse_count, 1,
                           Limits::max_iterations));
  CANDELA_TRY(set_if_given(stop.time_seconds, options.time, "--time", parse_duration));
  CANDELA_TRY(set_if_given(stop.relmse, options.until, "--until", parse_until));
  return stop;
}

Result<film::HalfSets> parse_exact_indices(const SceneOptions& options) {
  if (!options.indices) return film::HalfSets();
  const std::pair<bool, const char*> others[] = {{options.spp.has_value(), "--spp"},
                                                 {options.iterations.has_value(), "--iterations"},
                                                 {options.time.has_value(), "--time"},
                                                 {options.until.has_value(), "--until"}};
  for (const auto& [given, option] : others)
    if (given)
      return usage_error(fmt::format("--indices and {} exclude each other", option))
          .with_mend("--indices asks for exactly these iterations of each half");
  auto sets = film::parse_half_indices(*options.indices);
  if (!sets) return std::move(sets).error().with_field("--indices");
  return sets;
}

std::uint64_t iterations_of(std::uint64_t spp, std::uint64_t samples_per_iteration) {
  const std::uint64_t each = std::max<std::uint64_t>(samples_per_iteration, 1);
  return spp / each + (spp % each == 0 ? 0 : 1);
}

Result<void> keep_effort_of(const JobSettings& was, const RendererFacts& facts, PreparedJob& job) {
  JobSettings& settings = job.settings;
  if (job.of_effort.empty() || was.integrator != settings.integrator) return {};
  for (auto& [name, value] : job.of_effort) {
    const auto found = was.integrator_settings.find(name);
    if (found != was.integrator_settings.end()) settings.integrator_settings[name] = value = found->second;
  }
  CANDELA_ASSIGN(const std::uint64_t each,
                 facts.samples_per_iteration(settings.integrator, settings.integrator_settings));
  if (job.spp > 0) job.stop.iterations = iterations_of(job.spp, each);
  return {};
}

Result<std::map<std::string, std::string>> parse_assignments(const std::vector<std::string>& texts,
                                                             std::string_view option) {
  std::map<std::string, std::string> map;
  for (const std::string& text : texts) {
    CANDELA_ASSIGN(auto assignment, parse_assignment(text, option));
    if (!map.insert(assignment).second)
      return usage_error(fmt::format("'{}' is given twice", printable(assignment.first)))
          .with_field(std::string(option));
  }
  return map;
}

Result<PreparedJob> prepare_job(const description::SceneDescription& scene, const SceneOptions& options,
                                const RendererFacts& facts) {
  const ObjectPtr sensor = first_child(scene.scene.get(), "sensor");
  if (sensor == nullptr) return scene_error(*scene.scene, "the scene has no sensor");
  const ObjectPtr film = first_child(sensor.get(), "film");
  const ObjectPtr sampler = first_child(sensor.get(), "sampler");
  PreparedJob job;
  CANDELA_TRY(resolve_filter(film.get(), options, job.settings));
  CANDELA_TRY(resolve_size(film.get(), options, job.settings));
  if (job.settings.crop && (sensor->plugin == "distant" || sensor->plugin == "irradiancemeter"))
    return usage_error(fmt::format("the sensor '{}' has no crop of its image", sensor->plugin))
        .with_field("--crop");
  CANDELA_ASSIGN(job.settings.aovs, resolve_aovs(scene.aovs, options));
  CANDELA_ASSIGN(job.settings.layers, resolve_layers(scene, options));
  CANDELA_ASSIGN(job.spp, resolve_sampling(sampler.get(), options, job));
  CANDELA_TRY(resolve_integrator(*scene.scene, options, facts, job));
  CANDELA_ASSIGN(job.settings.edits, resolve_edits(scene, options, job.settings));
  if (job.spp > 0) {
    CANDELA_ASSIGN(const std::uint64_t each,
                   facts.samples_per_iteration(job.settings.integrator, job.settings.integrator_settings));
    job.stop.iterations = iterations_of(job.spp, each);
  }
  return job;
}

Result<std::uint64_t> scene_memory_bytes(const SceneOptions& options) {
  CANDELA_ASSIGN(const Config config, Config::load());
  const std::string key = "scene-memory";
  const std::optional<std::string> text = options.scene_memory ? options.scene_memory : config.get(key);
  if (!text) return 0;
  if (const auto bytes = parse_bytes(*text)) return *bytes;
  return usage_error(fmt::format("'{}' is not a size in bytes such as 500M or 20G", *text))
      .with_field(options.scene_memory ? "--scene-memory" : config.origin(key));
}

Result<void> check_options(const SceneOptions& options) {
  CANDELA_TRY(parse_assignments(options.defines, "-D"));
  CANDELA_TRY(parse_assignments(options.sets, "--set"));
  CANDELA_TRY(parse_stop(options));
  CANDELA_TRY(parse_exact_indices(options));
  CANDELA_TRY(resolve_aovs({}, options));
  CANDELA_ASSIGN(const letters::LayerRequest layers, parse_layers(options));
  if (!layers.empty())
    if (auto checked = letters::check(layers); !checked)
      return std::move(checked).error().with_field("--layer");
  CANDELA_TRY(read_edits(options));
  if (options.size) CANDELA_TRY(parse_size(*options.size, "--size"));
  if (options.crop) CANDELA_TRY(parse_crop(*options.crop, "--crop"));
  if (options.seed) CANDELA_TRY(parse_count(*options.seed, "--seed", 0, UINT64_MAX));
  CANDELA_TRY(scene_memory_bytes(options));
  return {};
}

Result<LoadedScene> load_scene(const SceneOptions& options, const RendererFacts& facts,
                               bundle::FileHashes* hashes) {
  // A bad option is told at once, not after a scene of gigabytes was hashed.
  CANDELA_TRY(check_options(options));
  CANDELA_ASSIGN(const auto parameters, parse_assignments(options.defines, "-D"));
  CANDELA_ASSIGN(const std::uint64_t memory, scene_memory_bytes(options));
  CANDELA_ASSIGN(bundle::GatheredScene gathered,
                 bundle::gather(options.scene, parameters, options.reading(), memory, hashes));
  CANDELA_ASSIGN(PreparedJob job, prepare_job(gathered.description, options, facts));
  return LoadedScene{std::move(gathered), std::move(job),
                     std::filesystem::absolute(options.scene).parent_path(), memory, options.scene};
}

std::string difference(const JobSettings& now, const JobSettings& was) {
  std::vector<std::string> lines;
  const auto compare = [&](std::string_view name, const auto& a, const auto& b) {
    if (a != b) lines.push_back(fmt::format("{} is {}, was {}", name, a, b));
  };
  const auto compare_maps = [&](const SettingsMap& a, const SettingsMap& b) {
    for (const auto& [key, value] : a) {
      const auto found = b.find(key);
      compare(key, value, found == b.end() ? std::string("unset") : found->second);
    }
    for (const auto& [key, value] : b)
      if (!a.contains(key)) compare(key, std::string("unset"), value);
  };
  compare("integrator", now.integrator, was.integrator);
  compare_maps(now.integrator_settings, was.integrator_settings);
  compare("width", now.width, was.width);
  compare("height", now.height, was.height);
  const auto crop = [](const JobSettings& s) {
    return s.crop ? fmt::format("{},{} of {}x{}", s.crop->x, s.crop->y, s.crop->whole_width,
                                s.crop->whole_height)
                  : std::string("none");
  };
  compare("crop", crop(now), crop(was));
  compare("filter", now.filter, was.filter);
  if (now.filter == was.filter) compare_maps(now.filter_settings, was.filter_settings);
  compare("sampler", now.sampler, was.sampler);
  compare("seed", now.seed, was.seed);
  compare("isa", now.isa, was.isa);
  compare("aovs", now.aovs, was.aovs);
  compare("layers", now.layers, was.layers);
  compare("edits", now.edits, was.edits);
  return fmt::format("{}", join(lines, "; "));
}

}  // namespace candela::client
