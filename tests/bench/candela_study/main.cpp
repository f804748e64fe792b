// candela-study: remakes figures and tables of papers (docs/studies).
#include <fmt/format.h>
#include <time.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string>

#include "common/base/files.h"
#include "common/base/memory.h"
#include "common/base/path_options.h"
#include "common/base/version.h"
#include "tests/bench/candela_bench/machine.h"
#include "tests/bench/candela_study/csv.h"
#include "tests/bench/candela_study/study.h"
#include "tests/paths.h"

namespace {

using namespace candela;
using namespace candela::study;

struct Options {
  std::string name, out;
  std::uint64_t seeds = 0;  // 0: the study's own
  unsigned threads = 1;
  std::uint32_t side = 0;  // 0: the study's own
  std::vector<std::string> scenes;
  bool list = false, short_form = false, no_figure = false;
};

int fail(const Error& error) {
  std::fprintf(stderr, "candela-study: error: %s\n", error.to_string().c_str());
  return error.exit_code();
}

double cpu_seconds() {
  timespec time{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

std::string names() {
  std::string text;
  for (const Study& study : studies()) text += (text.empty() ? "" : ", ") + std::string(study.name);
  return text;
}

std::string quoted(const std::string& word) {
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

// The figure and the page, by Python.
Result<void> draw(const std::string& csv) {
  const std::string script = test::source_path("tests/bench/candela_study/draw.py");
  if (std::system((CANDELA_PYTHON " " + quoted(script) + ' ' + quoted(csv)).c_str()) != 0)
    return failed_error("no figure was drawn")
        .at(script, 0)
        .with_mend("the line above says why; the CSV is written, and --no-figure leaves the figure out");
  return {};
}

Result<void> run(const Options& options) {
  const Study* study = find_study(options.name);
  if (study == nullptr)
    return usage_error(fmt::format("there is no study '{}'", options.name)).with_mend("one of " + names());
  if (options.out.empty()) return usage_error("no folder is given").with_field("--out");
  if (options.seeds != 0 && study->seeds == 0)
    return usage_error(fmt::format("study '{}' renders nothing that has a seed", study->name))
        .with_field("--seeds");
  if (!study->in_pieces && options.side != 0)
    return usage_error(fmt::format("study '{}' has one size", study->name)).with_field("--side");
  if (!study->in_pieces && !study->by_scene && !options.scenes.empty())
    return usage_error(fmt::format("study '{}' has all of its scenes", study->name)).with_field("--scenes");
  // Before the work, not after it.
  const std::filesystem::path folder = std::filesystem::absolute(options.out);
  CANDELA_TRY(make_directories(folder));
  const std::string csv = folder / (options.name + ".csv");
  CANDELA_TRY(write_file_atomically(csv, ""));

  Request request;
  request.short_form = options.short_form;
  request.seeds = options.seeds != 0 ? options.seeds : options.short_form ? study->short_seeds : study->seeds;
  request.threads = options.threads;
  request.side = options.side;
  request.scenes = options.scenes;
  if (study->in_pieces && !options.short_form) request.folder = folder / (options.name + "-pieces");
  request.say = [](const std::string& line) { std::fprintf(stderr, "%s\n", line.c_str()); };
  const bench::Machine machine = bench::this_machine();
  const std::string commit = commit_of(test::source_path(""));
  CANDELA_ASSIGN(const Results results, study->run(request));

  const std::string seeds = study->seeds == 0 ? "" : fmt::format(" --seeds {}", request.seeds);
  const std::string side = options.side == 0 ? "" : fmt::format(" --side {}", options.side);
  const std::string scenes = study->by_scene && !options.scenes.empty()
                                 ? fmt::format(" --scenes {}", fmt::join(options.scenes, ","))
                                 : "";
  const std::string command = fmt::format("candela-study {}{}{}{}{} --out DIR", study->name,
                                          options.short_form ? " --short" : "", seeds, side, scenes);
  const Head head = {{"study", std::string(study->name)},
                     {"summary", std::string(study->summary)},
                     {"source", std::string(study->source)},
                     {"command", command},
                     {"commit", commit},
                     {"build", std::string(build_id())},
                     {"compiler", machine.compiler},
                     {"cpu", machine.cpu},
                     {"cores", std::to_string(machine.cores)},
                     {"seeds", study->seeds == 0 ? "fixed" : fmt::format("1 to {}", request.seeds)},
                     {"started", machine.started},
                     {"cpu_seconds", fmt::format("{:.0f}", cpu_seconds())}};
  CANDELA_TRY(write_file_atomically(csv, csv_of(head, results.rows)));
  if (!results.maps.empty())
    CANDELA_TRY(write_file_atomically(folder / (options.name + "-maps.csv"), csv_of(results.maps)));
  std::printf("%s\n", csv.c_str());
  std::fflush(stdout);
  return options.no_figure ? Result<void>() : draw(csv);
}

constexpr const char* kExamples = R"(
Examples:
  candela-study --list
  candela-study bias-aware --out results            # results/bias-aware.csv, .png and .md
  candela-study ups-alpha --short --out results     # the same in seconds, with few samples
  candela-study ups-alpha --seeds 4 --out results --no-figure)";

}  // namespace

int main(int argc, char** argv) {
  candela::keep_freed_memory();
  if (const char* feature = missing_cpu_feature()) {
    std::fprintf(stderr, "candela-study: error: this CPU lacks %s, for which this program was built\n",
                 feature);
    return 2;
  }
  CLI::App app(
      "Remakes figures and tables of papers with Candela (docs/studies): a CSV, a figure and a page of each.",
      "candela-study");
  app.set_version_flag("--version", std::string(version()) + " (" + std::string(build_id()) + ")");
  app.footer(kExamples);
  Options options;
  app.add_option("study", options.name, "its name: " + names());
  app.add_flag("--list", options.list, "list the studies");
  app.add_option("--out", options.out, "folder of the results; created if absent")->type_name("DIR");
  app.add_flag("--short", options.short_form, "seconds in place of minutes: few samples, small images");
  app.add_option("--seeds", options.seeds, "independent renders; default: the study's own")
      ->check(CLI::Range(1, 1000));
  app.add_option("--threads", options.threads, "of each render; default: 1")->check(CLI::Range(1, 1024));
  app.add_option("--side", options.side, "of pictures, in pixels; default: the study's own (vcmplus-table)")
      ->check(CLI::Range(8, 4096));
  app.add_option("--scenes", options.scenes,
                 "these alone, with commas between; default: all (fppm-comparison, fppm-scenes, mis-scenes, "
                 "upbp-scenes, vcmplus-table)")
      ->delimiter(',');
  app.add_flag("--no-figure", options.no_figure, "write the CSV alone; needs no Python");
  refuse_empty_paths(app);
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  if (const std::string bare = option_without_value(arguments); !bare.empty())
    return fail(usage_error("the option has no value").with_field(bare));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;  // --help is an "error" too
  }
  if (options.list) {
    for (const Study& study : studies())
      std::printf("%-12s %s (%s)\n", std::string(study.name).c_str(), std::string(study.summary).c_str(),
                  std::string(study.source).c_str());
    return std::fflush(stdout) == 0 ? 0 : 1;
  }
  if (options.name.empty()) return fail(usage_error("no study is given").with_mend("one of " + names()));
  const Result<void> done = run(options);
  return done.ok() ? 0 : fail(done.error());
}
