// candela doctor: whether this machine, its configuration and its farm are fit, as a bug report needs it.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <ostream>

#include "client/commands/commands.h"
#include "client/context.h"
#include "client/doctor/checks.h"
#include "client/values.h"
#include "common/base/daemon.h"
#include "common/wire/json_values.h"

namespace candela::client {
namespace {

struct DoctorOptions {
  FarmOptions farm;
  std::optional<std::string> data, cache;
  bool json = false;
};

Diagnosis broken_configuration(const Error& error) {
  return {"configuration", Diagnosis::State::broken, printable(error.to_string()),
          "correct it; $CANDELA_CONFIG names another file"};
}

// The folder that an option names, else the configuration, else nothing.
void add_folder(std::vector<Diagnosis>& checks, const char* name, const std::optional<std::string>& option,
                std::optional<std::string> configured) {
  if (option)
    checks.push_back(check_folder(name, *option, true));
  else if (configured && !configured->empty())
    checks.push_back(check_folder(name, *configured, false));
}

void add_folders(std::vector<Diagnosis>& checks, const DoctorOptions& options, const Config& config) {
  const auto of_section = [&](const std::string& section, const std::string& key) {
    const auto own = config.get(section + "." + key);
    return own ? own : config.get(key);
  };
  add_folder(checks, "data folder", options.data, of_section("master", "data"));
  std::optional<std::string> cache = of_section("worker", "cache");
  if (!cache)
    if (const auto folder = default_cache_folder()) cache = folder->string();
  add_folder(checks, "cache folder", options.cache, cache);
  checks.push_back(check_folder("this folder", ".", false));
}

void add_farm_checks(std::vector<Diagnosis>& checks, const DoctorOptions& options, const Config& config) {
  const auto connection = resolve_connection(options.farm, config);
  if (!connection) {
    // Only who has a farm needs one.
    const bool absent = !options.farm.master && !config.get("master") && !config.get("client.master");
    checks.push_back(
        absent ? Diagnosis{"master", Diagnosis::State::skipped, "none is given", "--master HOST:PORT"}
               : broken_configuration(connection.error()));
    return;
  }
  for (auto* part : {&check_certificates, &check_farm})
    for (Diagnosis& check : part(*connection)) checks.push_back(std::move(check));
}

std::vector<Diagnosis> examine(const DoctorOptions& options, const RendererFacts& facts) {
  std::vector<Diagnosis> checks = {
      check_program(), check_system(),     check_processor(facts.supported_isas()),
      check_memory(),  check_open_files(), check_images()};
  const auto config = Config::load();
  if (!config) {
    checks.push_back(broken_configuration(config.error()));
    return checks;
  }
  if (const auto known = config->check_shared(); !known) {
    checks.push_back(broken_configuration(known.error()));
    return checks;
  }
  add_folders(checks, options, *config);
  add_farm_checks(checks, options, *config);
  return checks;
}

void print_checks(std::ostream& out, const std::vector<Diagnosis>& checks) {
  for (const Diagnosis& check : checks) {
    out << fmt::format("{:<8} {:<13} {}\n", name(check.state), check.name, check.text);
    if (!check.mend.empty()) out << fmt::format("{:<8} {:<13} mend: {}\n", "", "", check.mend);
  }
}

std::string checks_json(const std::vector<Diagnosis>& checks, bool fit) {
  wire::Json report;
  report["fit"] = fit;
  report["checks"] = wire::Json::array();
  for (const Diagnosis& check : checks)
    report["checks"].push_back(
        {{"name", check.name}, {"state", name(check.state)}, {"text", check.text}, {"mend", check.mend}});
  return wire::json_text(report);
}

Result<int> run_doctor(Context& context, const DoctorOptions& options) {
  const std::vector<Diagnosis> checks = examine(options, context.facts);
  const auto is_broken = [](const Diagnosis& check) { return check.state == Diagnosis::State::broken; };
  const bool fit = std::none_of(checks.begin(), checks.end(), is_broken);
  if (options.json)
    context.out << checks_json(checks, fit) << '\n';
  else
    print_checks(context.out, checks);
  return fit ? 0 : 1;
}

}  // namespace

void add_doctor(CLI::App& app, Context& context) {
  auto options = std::make_shared<DoctorOptions>();
  CLI::App* sub = app.add_subcommand(
      "doctor", "Diagnose this machine, its configuration and its farm; exits with 1 if something is broken");
  add_text(*sub, "--data", options->data,
           "Also check this data folder of a master; default: the configuration's", "DIR");
  add_text(*sub, "--cache", options->cache,
           "Diagnose this cache folder of a worker; default: the one it would use", "DIR");
  add_farm_options(*sub, options->farm);
  sub->add_flag("--json", options->json, "Print JSON");
  set_command(*sub, context, run_doctor, options);
}

}  // namespace candela::client
