// candela-bench: error over time of the integrators, the instrument of docs/bench.md.
#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <cstdio>
#include <map>
#include <numeric>
#include <string>
#include <vector>

#include "common/base/files.h"
#include "common/base/memory.h"
#include "common/base/path_options.h"
#include "common/base/version.h"
#include "common/job/aov.h"
#include "common/letters/request.h"
#include "tests/bench/candela_bench/coverage.h"
#include "tests/bench/candela_bench/process.h"
#include "tests/bench/candela_bench/schedule.h"
#include "tests/bench/candela_bench/truth.h"

namespace {

using namespace candela;
using namespace candela::bench;

// Set by a signal, which can reach nothing else.
std::atomic<bool> stop_requested{false};

void request_stop(int) {
  stop_requested.store(true);
}

void listen_for_signals() {
  struct sigaction action {};
  action.sa_handler = request_stop;
  action.sa_flags = static_cast<int>(SA_RESETHAND);  // the second one ends the program
  ::sigaction(SIGINT, &action, nullptr);
  ::sigaction(SIGTERM, &action, nullptr);
  ::signal(SIGPIPE, SIG_IGN);
}

int fail(const Error& error) {
  std::fprintf(stderr, "candela-bench: error: %s\n", error.to_string().c_str());
  return error.exit_code();
}

// Rows on a full disk are lost rows.
int finish(int code) {
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return code;
  return fail(resource_error("standard output cannot be written").with_mend("make room, or use --out"));
}

void say(const std::string& line) {
  std::fprintf(stderr, "%s\n", line.c_str());
}

EstimatorFactory processes() {
  const std::string program = std::filesystem::read_symlink("/proc/self/exe").string();
  return [program](const RunSpec& run) { return make_process_estimator(program, run); };
}

// Loads each reference once.
class References {
 public:
  explicit References(bool with_flip) : with_flip_(with_flip) {}
  Result<std::shared_ptr<const Reference>> get(const std::string& path) {
    if (const auto found = loaded_.find(path); found != loaded_.end()) return found->second;
    CANDELA_ASSIGN(auto reference, Reference::read(path, with_flip_));
    return loaded_[path] = reference;
  }

 private:
  bool with_flip_;
  std::map<std::string, std::shared_ptr<const Reference>> loaded_;
};

Result<int> run(const RunOptions& options) {
  Schedule schedule;
  schedule.machine = this_machine();  // before anything else: the load is that of others
  CANDELA_ASSIGN(const Work work, prepare(options));
  std::optional<Store> store;
  if (!work.out.empty()) {
    CANDELA_ASSIGN(Store opened, Store::open(work.out));
    CANDELA_TRY(opened.lock());
    CANDELA_TRY(opened.check_names(work.runs));
    store = std::move(opened);
  }
  schedule.budget = work.budget;
  schedule.reference_factor = work.reference_factor;
  schedule.beside = work.beside;
  schedule.flip = work.flip;
  schedule.stop = &stop_requested;
  schedule.say = say;
  References references(work.flip);
  const auto read = [&](const std::string& path) { return references.get(path); };
  const std::vector<RunResult> results =
      run_all(work.runs, schedule, processes(), read, store ? &*store : nullptr);

  int code = 0;
  for (const RunResult& result : results)
    if (result.error) {
      std::fprintf(stderr, "candela-bench: error: %s with %s, seed %llu: %s\n", result.run.scene.c_str(),
                   result.run.variant.c_str(), static_cast<unsigned long long>(result.run.job.seed),
                   result.error->to_string().c_str());
      code = result.error->exit_code();
    }
  if (store) {
    CANDELA_TRY(store->collect());
    for (const RunSpec& spec : work.runs) {
      CANDELA_ASSIGN(const auto reference, references.get(spec.reference));
      CANDELA_TRY(store->write_image("reference-" + spec.scene, reference->width(), reference->height(),
                                     reference->rgb()));
    }
    std::printf("%s\n", (store->folder() / "rows.csv").c_str());
  } else {
    bool header = true;
    for (const RunResult& result : results) {
      CANDELA_ASSIGN(const auto reference, references.get(result.run.reference));
      std::fputs(csv_of(result.run, result.rows, reference.get(), header).c_str(), stdout);
      header = false;
    }
  }
  if (stop_requested) {
    std::fprintf(stderr, "candela-bench: stopped%s\n", store ? "; the same command goes on" : "");
    return 130;
  }
  return code;
}

struct CountOptions {
  std::string scene, size, aovs, layers;
  std::vector<std::string> integrators, sets;
  std::uint64_t seed = 1, iterations = 8;
};

bool parse_size(const std::string& text, std::uint32_t& width, std::uint32_t& height) {
  char end = 0;
  return std::sscanf(text.c_str(), "%ux%u%c", &width, &height, &end) == 2 && width > 0 && height > 0 &&
         width <= Limits::max_extent && height <= Limits::max_extent;
}

Error size_error() {
  return usage_error("not WIDTHxHEIGHT").with_field("--size");
}

// In this process, on one thread: what tests/bench/guard.py and features.py count the instructions of.
Result<void> count(const CountOptions& options, const std::string& integrator) {
  std::uint32_t width = 0, height = 0;
  if (!parse_size(options.size, width, height)) return size_error();
  CANDELA_ASSIGN(const SettingsMap given, settings_for(integrator, options.integrators, options.sets));
  CANDELA_ASSIGN(RunSpec run,
                 make_run(options.scene, scene_name_of(options.scene), integrator, given, width, height));
  run.job.seed = options.seed;
  CANDELA_ASSIGN(const std::vector<Aov> aovs, parse_aovs(options.aovs));
  run.job.aovs = text_of(aovs);
  if (!options.layers.empty()) {
    letters::LayerRequest layers;
    CANDELA_TRY(letters::add_layers(options.layers, layers));
    run.job.layers = letters::text_of(layers);
  }
  CANDELA_ASSIGN(const auto estimator, make_render_estimator(run));
  CANDELA_ASSIGN(const Cost cost, estimator->advance(options.iterations));
  end_counting();
  CANDELA_ASSIGN(const Snapshot snapshot, estimator->snapshot());
  const double mean = std::accumulate(snapshot.image.begin(), snapshot.image.end(), 0.0) /
                      static_cast<double>(snapshot.image.size());
  std::printf(
      "{\"integrator\": \"%s\", \"units\": %llu, \"rays\": %llu, \"cpu_seconds\": %.6f, \"mean\": %.9g, "
      "\"own_relmse\": %.17g, \"compiler\": \"%s\"}\n",
      integrator.c_str(), static_cast<unsigned long long>(cost.units),
      static_cast<unsigned long long>(cost.rays), cost.cpu_seconds, mean, snapshot.own_relmse,
      this_machine().compiler.c_str());
  return {};
}

// Kept apart from what libraries may print.
int serve_on_standard_streams() {
  const int out = ::fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 3);
  ::dup2(STDERR_FILENO, STDOUT_FILENO);
  return serve(STDIN_FILENO, out, make_render_estimator);
}

}  // namespace

int main(int argc, char** argv) {
  candela::keep_freed_memory();
  if (const char* feature = missing_cpu_feature()) {
    std::fprintf(stderr, "candela-bench: error: this CPU lacks %s, for which this program was built\n",
                 feature);
    return 2;
  }
  CLI::App app(
      "Error over time of Candela's integrators (docs/bench.md). The scenes, integrators, settings and "
      "seeds\n"
      "that a list or the options name take turns in small slices; at log-spaced points their error against\n"
      "a reference is recorded, with what it took.",
      "candela-bench");
  app.require_subcommand(1);
  app.set_version_flag("--version", std::string(version()) + " (" + std::string(build_id()) + ")");
  RunOptions options;
  CLI::App& run_command =
      *app.add_subcommand("run", "runs a list, or one scene by options; goes on where rows are missing");
  run_command.add_option("list", options.list, "TOML file of scenes and runs (docs/bench.md)");
  run_command
      .add_option("--scene,--scenes", options.scenes,
                  "a scene file; with a list: names of its scenes, to run only these")
      ->allow_extra_args(false);
  run_command.add_option("--name", options.name, "what the scene is called in rows; default: after its file");
  run_command
      .add_option("--reference", options.reference,
                  "EXR to compare with, and NAME.stderr.exr beside it; its size is the image's")
      ->type_name("FILE");
  run_command
      .add_option("--integrator,--integrators", options.integrators,
                  "default: all there are; with a list: names of its runs, to do only these")
      ->allow_extra_args(false);
  run_command
      .add_option("--set", options.sets, "KEY=VALUE where an integrator has it, or INTEGRATOR.KEY=VALUE")
      ->allow_extra_args(false);
  run_command.add_option("--seed,--seeds", options.seeds, "default: the list's, or 1")
      ->check(CLI::NonNegativeNumber)
      ->allow_extra_args(false)
      ->delimiter(',');
  run_command.add_option("--iterations", options.iterations, "equal iterations: as many of each run")
      ->check(CLI::NonNegativeNumber);
  run_command.add_option("--time", options.seconds, "equal time: as many seconds of rendering of each run");
  run_command.add_option("--clock", options.clock, "what --time counts: cpu (default) or wall");
  run_command.add_option("--threads", options.threads, "of each render; default: 1")
      ->check(CLI::NonNegativeNumber);
  run_command.add_option("--out", options.out, "folder of rows; default: rows go to standard output")
      ->type_name("DIR");
  run_command.add_option("--slice", options.slice_seconds, "seconds of a turn; default: 0.5");
  run_command
      .add_option("--beside", options.beside, "how many runs are in memory and take turns; default: all")
      ->check(CLI::NonNegativeNumber);
  run_command
      .add_option("--points-per-doubling", options.points_per_doubling,
                  "rows a doubling of iterations or time; default: 1")
      ->check(CLI::NonNegativeNumber);
  run_command.add_option("--reference-factor", options.reference_factor,
                         "least measured squared error over the reference's own; default: 10");
  run_command.add_flag("--no-flip", options.no_flip, "leave FLIP out, the slowest of the figures");

  TruthOptions truth;
  std::string size;
  CLI::App& reference_command = *app.add_subcommand(
      "reference", "renders a reference with two integrators, refused where they disagree");
  reference_command.add_option("--scene", truth.scene_file, "a scene file")->required();
  reference_command.add_option("--size", size, "WIDTHxHEIGHT")->required();
  reference_command.add_option("--integrators", truth.integrators, "two of them, unbiased ones")
      ->allow_extra_args(false)
      ->delimiter(',')
      ->required();
  reference_command.add_option("--set", truth.sets, "KEY=VALUE or INTEGRATOR.KEY=VALUE")
      ->allow_extra_args(false);
  reference_command.add_option("--iterations", truth.iterations, "of each integrator")
      ->check(CLI::NonNegativeNumber)
      ->required();
  reference_command.add_option("--batches", truth.batches, "of each integrator; default: 16")
      ->check(CLI::NonNegativeNumber);
  reference_command
      .add_option("--block", truth.block, "pixels a side of the blocks that are compared; default: 16")
      ->check(CLI::NonNegativeNumber);
  reference_command.add_option("--threads", truth.threads, "default: 1")->check(CLI::NonNegativeNumber);
  reference_command.add_option("--out", truth.out, "NAME.exr; NAME.stderr.exr is written beside it")
      ->type_name("FILE")
      ->required();

  CoverageOptions coverage_options;
  CLI::App& coverage_command = *app.add_subcommand(
      "coverage", "whether the error that jobs show covers the error of their images; goes on after a stop");
  coverage_command.add_option("--out", coverage_options.out, "folder of what is rendered, and of rows")
      ->type_name("DIR")
      ->required();
  coverage_command.add_option("--scene,--scenes", coverage_options.scenes, "names; default: all")
      ->allow_extra_args(false)
      ->delimiter(',');
  coverage_command.add_option("--integrator,--integrators", coverage_options.integrators, "default: all")
      ->allow_extra_args(false)
      ->delimiter(',');
  coverage_command.add_option("--seeds", coverage_options.seeds, "how many; default: 1")
      ->check(CLI::PositiveNumber);
  coverage_command.add_option("--spp", coverage_options.last_spp, "the last of 4, 8, 16 ...; default: 1024")
      ->check(CLI::Range(4, 1 << 20));
  coverage_command.add_option("--side", coverage_options.side, "pixels of an image's side; default: 32")
      ->check(CLI::Range(8, 4096));
  coverage_command.add_option("--reference-spp", coverage_options.reference_spp,
                              "samples a pixel of references; default: the scene's");
  coverage_command.add_option("--cpu-minutes", coverage_options.cpu_minutes,
                              "after which no further scene is begun; default: no limit");
  coverage_command.add_flag("--chosen-only", coverage_options.chosen_only,
                            "leave out the scenes that were not looked at while the method was chosen");

  CountOptions count_options;
  CLI::App& count_command =
      *app.add_subcommand("count", "renders on one thread in this process; for counters of instructions");
  count_command.add_option("--scene", count_options.scene, "a scene file")->required();
  count_command.add_option("--size", count_options.size, "WIDTHxHEIGHT")->required();
  count_command
      .add_option("--integrator,--integrators", count_options.integrators, "one after another, a line each")
      ->allow_extra_args(false)
      ->delimiter(',')
      ->required();
  count_command
      .add_option("--set", count_options.sets,
                  "KEY=VALUE where an integrator has it, or INTEGRATOR.KEY=VALUE")
      ->allow_extra_args(false);
  count_command.add_option("--aov", count_options.aovs, "AOVs beside the image, as of candela render");
  count_command.add_option("--layers", count_options.layers,
                           "layers beside the image, as in a scene file: layer NAME=EXPR; ...");
  count_command.add_option("--seed", count_options.seed, "default: 1")->check(CLI::NonNegativeNumber);
  count_command.add_option("--iterations", count_options.iterations, "at least 2; default: 8")
      ->check(CLI::Range(2, 1 << 20));

  // The process that renders one run, asked through pipes.
  CLI::App& serve_command = *app.add_subcommand("serve", "");
  serve_command.group("");
  refuse_empty_paths(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;  // --help is an "error" too
  }

  if (serve_command.parsed()) return serve_on_standard_streams();
  listen_for_signals();
  if (run_command.parsed()) {
    const Result<int> code = run(options);
    return finish(code.ok() ? *code : fail(code.error()));
  }
  if (count_command.parsed()) {
    for (const std::string& integrator : count_options.integrators)
      if (const Result<void> done = count(count_options, integrator); !done.ok())
        return finish(fail(done.error()));
    return finish(0);
  }
  if (coverage_command.parsed()) {
    const Result<std::string> table = coverage(coverage_options, stop_requested, say);
    if (!table.ok()) return fail(table.error());
    std::fputs(table->c_str(), stdout);
    return finish(0);
  }
  if (!parse_size(size, truth.width, truth.height)) return fail(size_error());
  const auto made = make_truth(truth, processes(), stop_requested, say);
  if (!made.ok()) {
    const int code = fail(made.error());
    return stop_requested ? 130 : code;
  }
  std::printf("%s\n%s\n", truth.out.c_str(), made->c_str());
  return finish(0);
}
