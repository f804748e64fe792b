// Runs hostile scenes through the integrators and says how far along each sweep they stay within tolerance.
//
//   candela-stress list
//   candela-stress run [--sweep NAME]... [--integrator NAME]... [--effort X] [--csv FILE]
//   candela-stress table FILE...
//   candela-stress limits FILE...
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <thread>

#include "common/base/memory.h"
#include "common/base/path_options.h"
#include "tests/stress/report.h"
#include "tests/stress/scenes.h"

namespace {

using namespace candela::stress;

bool chosen(const std::vector<std::string>& names, const std::string& name) {
  return names.empty() || std::find(names.begin(), names.end(), name) != names.end();
}

void write(const std::string& path, const std::string& text) {
  std::ofstream out(path);
  if (!(out << text).flush()) throw std::runtime_error("cannot write " + path);
}

std::vector<Point> points_of(const std::string& file, const std::string& text) try {
  const auto sweeps = all_sweeps();
  std::vector<Point> points = read_csv(text);
  if (points.empty()) throw std::runtime_error("no points");
  for (const Point& p : points) find_sweep(sweeps, p.sweep);
  return points;
} catch (const std::exception& error) {
  throw std::runtime_error(file + ": " + error.what());
}

// Fails unless all that is asked for exists.
void check(const std::vector<Sweep>& sweeps, const std::vector<std::string>& only_sweeps,
           const std::vector<std::string>& only_integrators, const std::vector<double>& only_values) {
  for (const auto& name : only_sweeps) find_sweep(sweeps, name);
  const auto any_sweep = [&](const auto& has) {
    return std::any_of(sweeps.begin(), sweeps.end(),
                       [&](const Sweep& sweep) { return chosen(only_sweeps, sweep.name) && has(sweep); });
  };
  for (const auto& name : only_integrators)
    if (!any_sweep([&](const Sweep& sweep) {
          return std::any_of(sweep.claims.begin(), sweep.claims.end(),
                             [&](const Claim& claim) { return claim.integrator == name; });
        }))
      throw std::runtime_error("--integrator: none of these sweeps has '" + name + "'");
  for (const double value : only_values)
    if (!any_sweep([&](const Sweep& sweep) {
          return std::find(sweep.values.begin(), sweep.values.end(), value) != sweep.values.end();
        }))
      throw std::runtime_error(
          fmt::format("--value: none of these sweeps has {:g} (see candela-stress list)", value));
}

void list() {
  for (const Sweep& sweep : all_sweeps()) {
    fmt::print("{}\n  hazard: {}\n  parameter: {}\n  holds: {}\n  values:", sweep.name, sweep.hazard,
               sweep.parameter, sweep.holds);
    for (const double value : sweep.values) fmt::print(" {}", value);
    fmt::print("\n  tolerance: {:g} %\n  integrators:", 100 * sweep.tolerance);
    for (const Claim& claim : sweep.claims) fmt::print(" {}", claim.integrator);
    fmt::print("\n");
    for (const Excuse& excuse : sweep.excuses) fmt::print("  not {}: {}\n", excuse.integrator, excuse.why);
  }
}

}  // namespace

int main(int argc, char** argv) try {
  candela::keep_freed_memory();
  CLI::App app("hostile scenes for every integrator");
  app.require_subcommand(1);
  app.add_subcommand("list", "the sweeps: what they vary and what must hold")->callback(list);
  auto* run = app.add_subcommand("run", "runs sweeps");
  std::vector<std::string> only_sweeps, only_integrators;
  std::vector<double> only_values;
  double effort = 1;
  std::string csv_file;
  RunOptions options;
  options.threads = std::max(1U, std::thread::hardware_concurrency());
  run->add_option("--sweep", only_sweeps, "this one alone; may be repeated");
  run->add_option("--integrator", only_integrators, "this one alone; may be repeated");
  run->add_option("--value", only_values, "this value alone; may be repeated");
  run->add_option("--effort", effort, "times the rays after which a point is left undecided")
      ->check(CLI::PositiveNumber);
  run->add_option("--seed", options.seed, "of the first batch");
  run->add_option("--threads", options.threads, "default: one a processor")->check(CLI::Range(1, 1024));
  run->add_option("--csv", csv_file, "every point")->type_name("FILE");
  run->callback([&] {
    if (!std::isfinite(effort)) throw std::runtime_error("--effort: must be finite");
    options.most_rays *= effort;
    const auto sweeps = all_sweeps();
    check(sweeps, only_sweeps, only_integrators, only_values);
    std::vector<Point> points;
    if (!csv_file.empty()) write(csv_file, csv(points));
    for (const Sweep& sweep : sweeps) {
      if (!chosen(only_sweeps, sweep.name)) continue;
      for (const Claim& claim : sweep.claims) {
        if (!chosen(only_integrators, claim.integrator)) continue;
        Runner runner(sweep, claim, options);
        for (const double value : sweep.values) {
          if (!only_values.empty() &&
              std::find(only_values.begin(), only_values.end(), value) == only_values.end())
            continue;
          const Point p = runner.run(value);
          fmt::print(
              "{:20} {:7} {:>12.6g}  {:9}  {:.6g} for {:.6g}: off by {:.3g} +- {:.2g} ({}), rejected {}, "
              "{:.2f} s {}\n",
              p.sweep, p.integrator, p.value, name(p.verdict), p.measured, p.expected, p.deviation,
              p.stderr_of_deviation, p.quantity, p.rejected(), p.seconds, p.refusal);
          std::fflush(stdout);
          points.push_back(p);
        }
        if (!csv_file.empty()) write(csv_file, csv(points));  // a run takes long: what is done is kept
      }
    }
    if (points.empty()) throw std::runtime_error("no sweep has all of that: there is nothing to run");
  });
  std::vector<std::string> files;
  double most_seconds = 0.5;
  const auto read_files = [&] {
    std::vector<Point> points;
    for (const auto& file : files) {
      std::ifstream in(file);
      std::ostringstream text;
      if (!in || !(text << in.rdbuf())) throw std::runtime_error("cannot read " + file);
      for (const Point& p : points_of(file, text.str())) {
        std::erase_if(points, [&](const Point& q) {
          return q.sweep == p.sweep && q.integrator == p.integrator && q.value == p.value;
        });
        points.push_back(p);
      }
    }
    return points;
  };
  auto* table = app.add_subcommand("table", "the tables of what runs wrote with --csv; the last file counts");
  table->add_option("files", files)->required();
  table->callback([&] { fmt::print("{}", markdown(all_sweeps(), read_files())); });
  auto* limits = app.add_subcommand("limits", "what tests/stress/limits.txt is to say after such runs");
  limits->add_option("files", files)->required();
  limits->add_option("--most-seconds", most_seconds, "of the CPU, for a point of the short form");
  limits->callback([&] { fmt::print("{}", limits_text(all_sweeps(), read_files(), most_seconds)); });
  candela::refuse_empty_paths(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;  // --help is an "error" too
  }
  return 0;
} catch (const std::exception& error) {
  fmt::print(stderr, "candela-stress: error: {}\n", error.what());
  return 2;
}
