#include "tests/bench/candela_bench/spec.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "common/base/hash.h"
#include "common/base/version.h"
#include "common/bundle/gather.h"
#include "common/description/setting_text.h"
#include "common/description/text.h"
#include "worker/render/renderer.h"

namespace candela::bench {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

bool is_alphanumeric(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
}

// A word as a POSIX shell reads it back.
std::string shell_quote(const std::string& word) {
  const auto plain = [](char c) {
    return is_alphanumeric(c) || std::string_view("_-./=,:+@").find(c) != std::string_view::npos;
  };
  if (!word.empty() && std::all_of(word.begin(), word.end(), plain)) return word;
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

Json job_json(const JobSettings& job) {
  return {{"integrator", job.integrator},
          {"settings", job.integrator_settings},
          {"width", job.width},
          {"height", job.height},
          {"filter", job.filter},
          {"filter_settings", job.filter_settings},
          {"sampler", job.sampler},
          {"seed", job.seed},
          {"isa", job.isa}};
}

Result<bool> has_setting(const std::string& integrator, const std::string& name) {
  CANDELA_ASSIGN(const auto docs, render::integrator_settings(integrator));
  return std::any_of(docs.begin(), docs.end(), [&](const auto& doc) { return doc.name == name; });
}

}  // namespace

std::string RunSpec::to_json() const {
  const Json json = {{"scene", scene},     {"scene_file", scene_file}, {"scene_hash", scene_hash},
                     {"variant", variant}, {"given", given},           {"job", job_json(job)},
                     {"threads", threads}, {"reference", reference},   {"reference_hash", reference_hash}};
  return json.dump();
}

Result<RunSpec> RunSpec::from_json(std::string_view text) {
  try {
    const Json json = Json::parse(text);
    RunSpec spec;
    json.at("scene").get_to(spec.scene);
    json.at("scene_file").get_to(spec.scene_file);
    json.at("scene_hash").get_to(spec.scene_hash);
    json.at("variant").get_to(spec.variant);
    spec.given = json.at("given").get<SettingsMap>();
    const Json& job = json.at("job");
    job.at("integrator").get_to(spec.job.integrator);
    spec.job.integrator_settings = job.at("settings").get<SettingsMap>();
    job.at("width").get_to(spec.job.width);
    job.at("height").get_to(spec.job.height);
    job.at("filter").get_to(spec.job.filter);
    spec.job.filter_settings = job.at("filter_settings").get<SettingsMap>();
    job.at("sampler").get_to(spec.job.sampler);
    job.at("seed").get_to(spec.job.seed);
    job.at("isa").get_to(spec.job.isa);
    json.at("threads").get_to(spec.threads);
    json.at("reference").get_to(spec.reference);
    json.at("reference_hash").get_to(spec.reference_hash);
    return spec;
  } catch (const Json::exception& error) {
    return input_error(fmt::format("not a run's description: {}", error.what()));
  }
}

std::string RunSpec::id() const {
  const Json key = {{"scene", scene_hash},
                    {"job", job_json(job)},
                    {"threads", threads},
                    {"reference", reference_hash},
                    {"variant", variant},
                    {"name", scene},
                    {"build", std::string(build_id())}};
  return file_name_of(scene + '-' + variant + '-' + std::to_string(job.seed)) + '-' +
         sha256_hex(key.dump()).substr(0, 12);
}

std::string file_name_of(std::string_view name) {
  std::string file;
  for (const char c : name) file += is_alphanumeric(c) || c == '-' || c == '.' ? c : '_';
  return file;
}

std::string scene_name_of(const fs::path& file) {
  if (file.stem() != "scene") return file.stem().string();
  const std::string folder = fs::absolute(file).lexically_normal().parent_path().filename().string();
  return folder.empty() ? "scene" : folder;
}

std::string command_of(const RunSpec& run, std::uint64_t iterations, bool flip, double reference_factor) {
  std::string command = fmt::format("candela-bench run --scene {} --name {} --reference {} --integrator {}",
                                    shell_quote(run.scene_file), shell_quote(run.scene),
                                    shell_quote(run.reference), run.job.integrator);
  for (const auto& [key, value] : run.given) command += " --set " + shell_quote(key + '=' + value);
  command += fmt::format(" --seed {} --iterations {} --threads {}", run.job.seed, iterations, run.threads);
  if (reference_factor != kReferenceFactor)
    command += fmt::format(" --reference-factor {}", reference_factor);
  return command + (flip ? "" : " --no-flip");
}

Result<SettingsMap> settings_for(const std::string& integrator, const std::vector<std::string>& integrators,
                                 const std::vector<std::string>& sets) {
  SettingsMap given;
  for (const std::string& text : sets) {
    const auto equals = text.find('=');
    if (equals == 0 || equals == std::string::npos || text[0] == '.')
      return usage_error(fmt::format("'{}' is not KEY=VALUE or INTEGRATOR.KEY=VALUE", text))
          .with_field("--set");
    std::string key = text.substr(0, equals);
    const auto dot = key.find('.');
    const std::string only = dot == std::string::npos ? "" : key.substr(0, dot);
    if (dot != std::string::npos) key = key.substr(dot + 1);
    bool known = false;
    for (const std::string& name : integrators) {
      if (!only.empty() && only != name) continue;
      CANDELA_ASSIGN(const bool has, has_setting(name, key));
      known |= has;
      if (has && name == integrator) given[key] = text.substr(equals + 1);
    }
    if (!known)
      return usage_error(
                 fmt::format("no integrator that is to run has a setting '{}'", text.substr(0, equals)))
          .with_field("--set")
          .with_mend("docs/integrators has a page of each with its settings");
  }
  return given;
}

Result<RunSpec> make_run(const std::string& scene_file, const std::string& scene_name,
                         const std::string& integrator, const SettingsMap& given, std::uint32_t width,
                         std::uint32_t height) {
  for (const std::string& text : {scene_file, scene_name})
    if (!description::text::is_utf8(text))
      return usage_error(fmt::format("{} is not UTF-8", description::text::quote(text)))
          .with_field("--scene")
          .with_mend("rows are CSV and JSON, which are: rename it");
  RunSpec run;
  run.scene = scene_name;
  run.scene_file = fs::absolute(scene_file).lexically_normal().string();
  CANDELA_ASSIGN(const bundle::GatheredScene gathered, bundle::gather(run.scene_file, {}));
  run.scene_hash = gathered.bundle.hash();
  run.variant = integrator;
  run.given = given;
  SettingsMap from_scene;
  for (const auto& written : gathered.description.scene->children_of("integrator"))
    for (const auto& property : written->properties) {
      CANDELA_ASSIGN(const bool known, has_setting(integrator, property.name));
      if (const auto text = setting_text(property); known && text) from_scene[property.name] = *text;
    }
  run.job.integrator = integrator;
  CANDELA_ASSIGN(run.job.integrator_settings,
                 render::complete_integrator_settings(integrator, from_scene, given));
  run.job.width = width;
  run.job.height = height;
  return run;
}

}  // namespace candela::bench
