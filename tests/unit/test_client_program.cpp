// The program around the commands: progress and JSON shapes, exit codes of bad usage, checks before
// rendering, the CLI reference.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

#include "client/embedded/app.h"
#include "client/embedded/commands.h"
#include "client/embedded/local_farm.h"
#include "client/embedded/state_folder.h"
#include "client/output.h"
#include "client/progress.h"
#include "common/wire/json.h"
#include "tests/paths.h"
#include "tests/unit/client_outcome.h"

namespace candela::client {
namespace {

namespace fs = std::filesystem;

Outcome run(std::vector<std::string> arguments) {
  return run_candela(arguments);
}

v1::JobStatus running_job() {
  v1::JobStatus s;
  s.set_id("j1");
  s.set_state(v1::JOB_STATE_RUNNING);
  s.mutable_stop()->set_iterations(128);
  s.set_iterations(54);
  s.mutable_settings()->set_width(400);
  s.mutable_settings()->set_height(250);
  s.set_samples_per_second(12.34e6);
  s.set_relmse_estimate(1.234e-3);
  s.set_eta_seconds(65);
  return s;
}

// Claim: the line shows what is known, and leaves out what is not.
TEST(Progress, Lines) {
  v1::JobStatus s = running_job();
  EXPECT_EQ(format_progress(s), " 42%  54/128 spp, 123 spp/s, relMSE 1.2e-03, ETA 1m05s");
  s.set_worker_memory_bytes(300 << 20);
  EXPECT_EQ(format_progress(s), " 42%  54/128 spp, 123 spp/s, relMSE 1.2e-03, ETA 1m05s, memory 300.0 MiB");
  s.set_worker_memory_bytes(0);
  s.mutable_stop()->set_relmse(1e-3);
  s.set_relmse_upper(2e-3);
  EXPECT_EQ(format_progress(s),
            " 50%  54/128 spp, 123 spp/s, relMSE 1.2e-03 (at most 2.0e-03), to 1.0e-03, ETA 1m05s");
  s = running_job();
  s.set_iterations(0);
  s.set_samples_per_second(0);
  s.set_relmse_estimate(std::nan(""));
  s.set_eta_seconds(std::nan(""));
  EXPECT_EQ(format_progress(s), "  0%  0/128 spp, preparing the scene");
  s = running_job();
  s.set_state(v1::JOB_STATE_DONE);
  s.set_iterations(128);
  EXPECT_EQ(format_progress(s), "100%  128/128 spp, relMSE 1.2e-03, done");
  s = running_job();
  s.set_iterations(128);
  s.set_samples_per_second(0);
  s.set_eta_seconds(std::nan(""));
  s.set_message("no room");  // why it does not move
  EXPECT_EQ(format_progress(s), " 99%  128/128 spp, relMSE 1.2e-03, no room");
}

// Claim: light that the plan knows to be found by luck, or never, stands among the warnings; other notes do
// not.
TEST(Progress, WarnsOfLightFoundByLuck) {
  v1::JobStatus s = running_job();
  s.set_plan(
      "use  media: there are some\nnote light found by luck: caustics; vcm finds it\nnote media: thick\n");
  EXPECT_EQ(lucky_light(s), std::vector<std::string>{"light found by luck: caustics; vcm finds it"});
  EXPECT_EQ(warnings_of(s),
            std::vector<std::string>{"the error may leave out light found by luck: caustics; vcm finds it"});
  s.set_plan("note light found by luck");
  EXPECT_TRUE(lucky_light(s).empty());
}

// Claim: a job of chains shows its bootstrap, and then b with its relative error; scripts get every figure.
TEST(Progress, OfChains) {
  v1::JobStatus s = running_job();
  s.set_iterations(0);
  s.set_samples_per_second(0);
  s.set_eta_seconds(std::nan(""));
  v1::ChainStatus& chains = *s.mutable_chains();
  chains.mutable_plan()->set_chains(1000);
  chains.mutable_plan()->set_bootstrap_samples(100000);
  chains.set_bootstrap_done(2500);
  chains.set_b(std::nan(""));
  EXPECT_EQ(format_progress(s), "  0%  0/128 iterations, bootstrap: 2500 of 100000 samples");
  EXPECT_TRUE(nlohmann::json::parse(wire::job_json(s)).at("chains").at("b").is_null());
  EXPECT_TRUE(nlohmann::json::parse(wire::job_json(s)).at("bootstrap_b").is_null());
  s.mutable_named_state()->set_bootstrap_b(0.5);
  s.set_units_merged(3);
  chains.set_b(0.51234);
  chains.set_b_standard_error(0.002);
  chains.set_b_samples(123456);
  v1::ChainGroupStatus& group = *chains.add_groups();
  group.set_mutations(10);
  group.set_longest_stay(4);
  group.set_stay_x(7.5F);
  // Rounds of 1000 segments of 1650 mutations are 16.5 mutations a pixel each.
  chains.mutable_plan()->set_segment_mutations(1650);
  EXPECT_EQ(format_progress(s), "  0%  0/2112 spp, b 0.5123 +- 0.4 %");
  s.set_iterations(3);
  EXPECT_EQ(format_progress(s).substr(0, 17), "  2%  49.5/2112 s");
  EXPECT_EQ(nlohmann::json::parse(wire::job_json(s)).at("samples_per_pixel"), 49.5);
  s.set_iterations(0);
  const auto json = nlohmann::json::parse(wire::job_json(s));
  EXPECT_EQ(json.at("bootstrap_b"), 0.5);
  EXPECT_EQ(json.at("chains").at("b_samples"), 123456);
  EXPECT_EQ(json.at("chains").at("bootstrap_done"), 2500);
  EXPECT_EQ(json.at("chains").at("groups").at(0).at("longest_stay"), 4);
  EXPECT_EQ(json.at("chains").at("groups").at(0).at("stay_pixel").at(0), 7.5);
  EXPECT_FALSE(json.at("chains").contains("by_mutation"));
  // The sums of all groups, from a renderer that tells them.
  for (v1::ChainGroupStatus* one : {&group, chains.add_groups()}) {
    v1::MutationStatus& lens = *one->add_by_mutation();
    lens.set_name("lens");
    lens.set_proposed(6);
    lens.set_accepted(2);
    (*lens.mutable_failed())["no_path"] = 1;
    lens.set_rays(30);
  }
  const auto lens = nlohmann::json::parse(wire::job_json(s)).at("chains").at("by_mutation").at("lens");
  EXPECT_EQ(lens,
            nlohmann::json({{"proposed", 12}, {"accepted", 4}, {"failed", {{"no_path", 2}}}, {"rays", 60}}));
}

// Claim: scripts get the epoch of a job and the figures of its state; other jobs have none.
TEST(Progress, OfEpochs) {
  v1::JobStatus s = running_job();
  EXPECT_TRUE(nlohmann::json::parse(wire::job_json(s)).at("epochs").is_null());
  v1::EpochStatus& epochs = *s.mutable_epochs();
  epochs.set_epoch(7);
  epochs.set_iterations(16);
  epochs.set_statistics_bytes(1000);
  v1::Figure& figure = *epochs.add_figures();
  figure.set_name("pixels shrunk");
  figure.set_value(12);
  const auto json = nlohmann::json::parse(wire::job_json(s)).at("epochs");
  EXPECT_EQ(json.at("epoch"), 7);
  EXPECT_EQ(json.at("iterations"), 16);
  EXPECT_EQ(json.at("statistics_bytes"), 1000);
  EXPECT_EQ(json.at("figures").at("pixels shrunk"), 12);
}

// Claim: 100% is shown of a job that is done only; with several limits the furthest counts.
TEST(Progress, FractionIsOfTheNearestEnd) {
  v1::JobStatus s = running_job();
  s.set_iterations(128);
  EXPECT_EQ(format_progress(s).substr(0, 4), " 99%");
  s.set_iterations(64);
  s.mutable_stop()->set_time_seconds(100);
  s.set_elapsed_seconds(75);
  EXPECT_DOUBLE_EQ(fraction_done(s), 0.75);
}

// Claim: off a terminal a line comes at once, then only every few seconds unless it is news; quiet says
// nothing.
TEST(Progress, PlainLinesAreFew) {
  std::ostringstream err;
  {
    ProgressLine line(err, ProgressLine::Mode::plain);
    line.show("one");
    line.show("two");
    line.show("three", true);
  }
  EXPECT_EQ(err.str(), "one\nthree\n");
  std::ostringstream silent;
  ProgressLine(silent, ProgressLine::Mode::quiet).show("one", true);
  EXPECT_EQ(silent.str(), "");
}

// Claim: `show --json` has the promised names; unknown numbers and unset limits are null; broken UTF-8 is no
// error.
TEST(Json, JobShape) {
  v1::JobStatus s = running_job();
  s.set_units_merged(7);
  s.set_message("caf\xe9");
  s.set_eta_seconds(std::numeric_limits<double>::infinity());
  const auto json = nlohmann::json::parse(wire::job_json(s));
  EXPECT_EQ(json.at("id"), "j1");
  EXPECT_EQ(json.at("state"), "running");
  EXPECT_EQ(json.at("units_merged"), 7);
  EXPECT_EQ(json.at("iterations"), 54);
  EXPECT_DOUBLE_EQ(json.at("error").get<double>(), 1.234e-3);
  EXPECT_TRUE(json.at("eta_seconds").is_null());
  EXPECT_EQ(json.at("stop").at("iterations"), 128);
  EXPECT_TRUE(json.at("stop").at("relmse").is_null());
  EXPECT_TRUE(json.contains("message"));
  EXPECT_TRUE(json.at("error_upper").is_null());  // of a master that does not tell it
  s.set_relmse_upper(3e-3);
  EXPECT_DOUBLE_EQ(nlohmann::json::parse(wire::job_json(s)).at("error_upper").get<double>(), 3e-3);
  s.set_relmse_estimate(std::nan(""));
  s.set_relmse_upper(std::nan(""));
  EXPECT_TRUE(nlohmann::json::parse(wire::job_json(s)).at("error").is_null());
  EXPECT_TRUE(nlohmann::json::parse(wire::job_json(s)).at("error_upper").is_null());
}

// Claim: lists are objects with named arrays, also when empty.
TEST(Json, ListShapes) {
  EXPECT_EQ(nlohmann::json::parse(wire::jobs_json({})),
            nlohmann::json::parse(R"({"jobs": [], "groups": [], "total": 0, "next": null})"));
  EXPECT_EQ(
      nlohmann::json::parse(wire::workers_json({})),
      nlohmann::json::parse(R"({"workers": [], "wanted": {"threads": 0, "workers": 0}, "distrusted": []})"));
  EXPECT_EQ(nlohmann::json::parse(wire::events_json({})), nlohmann::json::parse(R"({"events": []})"));
}

// Claim: bad usage is exit code 2 and one line "candela: error: ..." on standard error, nothing on standard
// output.
TEST(Program, BadUsageIsOneLineAndCodeTwo) {
  const std::string out = testing::TempDir() + "/x.exr";
  const struct {
    std::vector<std::string> arguments;
    std::string part;
  } cases[] = {
      {{"rendr"}, "there is no command 'rendr' (did you mean 'render'?)"},
      {{"render", "scene.xml", "-o", out, "--iteratons", "3"},
       "there is no option '--iteratons' (did you mean '--iterations'?)"},
      {{"render", "a.xml", "-o", "b.exr", "--partial"},
       "there is no option '--partial' (it is an option of 'fetch')"},
      {{"render", "a.xml", "-o", out, "--half", "C"}, "--half: 'C' is neither A nor B"},
      {{"render", "a.xml", "-o", out, "--half", "A", "--error-layer"}, "--half and --error-layer exclude"},
      {{"render", "a.xml", "-o", out, "--indices", "0-3/0-3", "--spp", "4"}, "--indices and --spp exclude"},
      {{"submit", "a.xml", "--indices", "0-3/0-3", "--iterations", "4"},
       "--indices and --iterations exclude"},
      {{"submit", "a.xml", "--indices", "0-3/0-3", "--time", "4s"}, "--indices and --time exclude"},
      {{"submit", "a.xml", "--indices", "0-3/0-3", "--until", "relmse=1"}, "--indices and --until exclude"},
      {{"submit", "a.xml", "--indices", "0-3"}, "--indices: '0-3' is not a set of indices for each half"},
      {{"submit", "a.xml", "--indices", "3-0/none"}, "--indices: the range '3-0' ends before it begins"},
      {{"render", "scene.xml", "-o", "x.png", "--png", "y.png"}, "--output: x.png and y.png are two PNGs"},
      {{"render", "scene.xml", "-o", "x.png", "--layers"}, "--layers: a PNG has no layers"},
      {{"submit", "scene.xml", "--frames", "1-3"}, "--frames: all frames would be the same image"},
      {{"submit", "s.{frame}.xml", "--frames", "3-1"}, "--frames: '3-1' is no range of frames"},
      {{"submit", "s.{frame}.xml", "--frames", "1-1000000000"}, "no range of frames from 0 to 99999999"},
      {{"submit", "s.{frame}.xml"}, "--frames: {frame} needs the frames"},
      {{"submit", "s.{frame}.xml", "--frames", "1-2", "--wait", "-o", "x.exr"},
       "--output: all frames would be written to one file"},
      {{"submit", "s.{frame}.xml", "--frames", "1-2", "--spp", "x"}, "error: --spp: 'x' is not"},
      {{"watch", "j1", "--on-end", " "}, "--on-end: the command is empty"},
      {{"priority", "j1"}, "a job and its new priority are needed"},
      {{"help", "vcmm"}, "there is no command or integrator 'vcmm' (did you mean 'vcm'?)"},
      {{"render", "-o", out}, "scene"},
      {{"render", "scene.xml", "-o", "x.tif"}, "--output: x.tif: the name does not end in .exr or .png"},
      {{"render", "scene.xml", "-o", "/nonexistent/x.exr"}, "there is no folder /nonexistent"},
      {{"render", "scene.xml", "-o", out, "--png", "x.exr"}, "--png: x.exr: the name does not end in .png"},
      {{"render", "scene.xml", "-o", out, "--workers", "0"}, "--workers: '0' is not a whole number from 1"},
      {{"render", "scene.xml", "-o", out, "--threads", "2", "--workers", "5"},
       "2 threads cannot be split among 5 workers"},
      {{"render", "scene.xml", "-o", out, "--size", "0x5"}, "--size: '0x5' is not a size"},
      {{"render", "scene.xml", "-o", out, "--time", "soon"}, "--time: 'soon' is not a duration"},
      {{"render", "scene.xml", "-o", out, "--spp", "4", "--spp", "8"},
       "--spp is given twice (see: candela render --help)"},
      {{"render", "scene.xml", "-o", out, "--resume", "--fresh"}, "exclude each other"},
      {{"render", "/nonexistent/scene.xml", "-o", out}, "/nonexistent/scene.xml"},
      {{"submit", "scene.xml", "--share", "nan"}, "--share"},
      {{"submit", "scene.xml", "-o", out}, "an output needs --wait"},
      {{"submit", "scene.xml", "--tev", "127.0.0.1:1"}, "--tev: an output needs --wait"},
      {{"submit", "scene.xml", "--variance-layer"}, "--variance-layer: an output needs --wait"},
      {{"submit", "scene.xml", "--denoise"}, "--denoise: an output needs --wait"},
      {{"submit", "scene.xml", "--wait", "--denoise"}, "--denoise: there is no image to denoise"},
      {{"submit", "scene.xml", "--wait", "--preview", "5s"}, "--preview: there is nothing to preview"},
      {{"submit", "scene.xml", "--wait", "--tev", "nowhere"}, "--tev"},
      {{"render", "scene.xml", "-o", out, "--aov", "colour"}, "--aov: there is no AOV 'colour'"},
      {{"extend", "j1"}, "nothing to extend by"},
      {{"extend", "j1", "--spp", "20"},
       "--spp: '20' does not say whether it is added or is a new limit (write --spp +20"},
      {{"extend", "j1", "--iterations", "20"}, "write --iterations +20"},
      {{"extend", "j1", "--time", "1h"}, "write --time +1h"},
      {{"extend", "j1", "--spp", "+"}, "--spp: '+' does not say"},
      {{"extend", "j1", "--iterations", "+1e308"}, "--iterations: '1e308' is not a whole number"},
      {{"extend", "j1", "--time", "+1e308"}, "--time: '1e308' is not a duration"},
      {{"extend", "j1", "--until", "relmse=1e308"}, "at most 1000000"},
      {{"show"}, "id"},
      {{"show", "j1", "--master", "nowhere"}, "--master"},
      {{"compare", "/nonexistent/a.exr", "/nonexistent/b.exr"}, "/nonexistent/a.exr"},
      {{"convert", "a.exr", "b.bmp"}, "the name does not end in .png, .jpg or .tif"},
      {{"convert", "a.exr", "b.exr"}, "an EXR is made with --denoise or --mix only"},
      {{"convert", "a.exr", "b.png", "--mix", "m.json", "--layer", "x"},
       "--layer and --mix exclude each other"},
      {{"convert", "a.exr", "b.exr", "--mix", "/nonexistent/m.json"}, "/nonexistent/m.json"},
      {{"fetch", "j1", "--mix", "m.json", "--error-layer"},
       "--error-layer: the error is estimated of the image"},
      {{"fetch", "j1", "--mix", "/nonexistent/m.json"}, "/nonexistent/m.json"},
      {{"inspect"}, "no command is given"},
      {{"inspect", "flasecolor", "a.exr"},
       "there is no command 'inspect flasecolor' (did you mean 'falsecolor'?)"},
      {{"inspect", "falsecolor", "a.exr", "-o", "b.png", "--layr", "x"},
       "there is no option '--layr' (did you mean '--layer'?)"},
      {{"inspect", "falsecolor", "a.exr"}, "(see: candela inspect falsecolor --help)"},
      {{"inspect", "falsecolor", "a.exr", "-o", "b.png", "--layer", "\xff"},
       "--layer: '\\xff' is not text in UTF-8"},
      {{}, "no command is given"},
      {{"submit", "scene.xml", "--name", "\xff"}, "--name: '\\xff' is not text in UTF-8"},
      {{"submit", "scene.xml", "--token", "a\xff"}, "--token: 'a\\xff' is not"},
      {{"submit", "scene.xml", "-D", "a=\xff"}, "--define: 'a=\\xff' is not"},
      {{"submit", "scene.xml", "--set", "a\xff=1"}, "--set: 'a\\xff=1' is not"},
      {{"show", "\xff"}, "ID...: '\\xff' is not"},
      {{"drain", "\xff"}, "WORKER: '\\xff' is not"},
      {{"show", "a\u202eb\nc", "--master", "\u202e"}, "'\\u202e' is not HOST:PORT"},
  };
  for (const auto& c : cases) {
    const Outcome r = run(c.arguments);
    const std::string shown = testing::PrintToString(c.arguments) + "\n" + r.err;
    EXPECT_EQ(r.code, 2) << shown;
    EXPECT_EQ(r.out, "") << shown;
    const std::size_t at = r.err.find("candela: error: ");
    ASSERT_NE(at, std::string::npos) << shown;
    EXPECT_EQ(r.err.find('\n', at), r.err.size() - 1) << shown;
    EXPECT_NE(r.err.find(c.part), std::string::npos) << shown;
  }
}

// Claim: an absent master is exit code 3, after the time that --timeout allows.
TEST(Program, UnreachableMasterIsCodeThree) {
  const Outcome r = run({"list", "--master", "127.0.0.1:1", "--timeout", "300ms"});
  EXPECT_EQ(r.code, 3) << r.err;
  EXPECT_NE(r.err.find("cannot reach the master at 127.0.0.1:1"), std::string::npos) << r.err;
}

// Claim: "help" as a command is --help, of the program or of the command that follows.
TEST(Program, HelpMayBeACommand) {
  EXPECT_EQ(run({"help"}).out, run({"--help"}).out);
  EXPECT_EQ(run({"help", "render"}).out, run({"render", "--help"}).out);
  EXPECT_EQ(run({"help", "render", "scene.xml"}).out, run({"render", "--help"}).out);
  EXPECT_EQ(run({"help", "inspect", "falsecolor", "a"}).out, run({"inspect", "falsecolor", "--help"}).out);
  EXPECT_NE(run({"help", "inspect"}).out.find("falsecolor"), std::string::npos);
  EXPECT_EQ(run({"help"}).code, 0);
  EXPECT_NE(run({"help", "rendr"}).err.find("there is no command 'rendr' (did you mean 'render'?)"),
            std::string::npos);
}

// Claim: `candela help INTEGRATOR` prints every setting of it with its default, and the program's help and
// that of --integrator name the integrators.
TEST(Program, HelpPrintsSettingsOfIntegrators) {
  const RendererFacts facts = renderer_facts();
  const Outcome r = run({"help", "vcm"});
  EXPECT_EQ(r.code, 0) << r.err;
  const auto settings = facts.setting_docs("vcm");
  ASSERT_TRUE(settings.ok());
  ASSERT_GT(settings->size(), 3U);
  for (const IntegratorSetting& setting : *settings) {
    const std::string line = "  " + setting.name + " (" + setting.type + "; default " +
                             (setting.default_value.empty() ? "none" : setting.default_value) + ")\n";
    EXPECT_NE(r.out.find(line), std::string::npos) << line << r.out;
  }
  for (const std::string& name : facts.integrator_names())
    for (const std::vector<std::string>& help :
         std::vector<std::vector<std::string>>{{"--help"}, {"submit", "--help"}})
      EXPECT_NE(run(help).out.find(name), std::string::npos) << name;
}

// Claim: help is as wide as $COLUMNS says, and says the same.
TEST(Program, HelpWrapsToTheTerminal) {
  const auto words = [](const std::string& text) {
    std::istringstream in(text);
    return std::vector<std::string>(std::istream_iterator<std::string>(in), {});
  };
  const std::string whole = run({"submit", "--help"}).out;
  for (const char* columns : {"100", "80", "50"}) {
    ::setenv("COLUMNS", columns, 1);
    const std::string wrapped = run({"submit", "--help"}).out;
    ::unsetenv("COLUMNS");
    EXPECT_EQ(words(wrapped), words(whole));
    std::istringstream lines(wrapped);
    for (std::string line; std::getline(lines, line);) {
      if (!line.starts_with("  candela ")) {
        EXPECT_LE(line.size(), static_cast<std::size_t>(std::atoi(columns))) << line;
      }
    }
  }
}

// Claim: help and version are exit code 0 on standard output.
TEST(Program, HelpAndVersion) {
  for (const auto& arguments :
       std::vector<std::vector<std::string>>{{"--help"}, {"render", "--help"}, {"--version"}, {"version"}}) {
    const Outcome r = run(arguments);
    EXPECT_EQ(r.code, 0) << r.err;
    EXPECT_NE(r.out, "");
    EXPECT_EQ(r.err, "");
  }
}

// Claim: docs/cli.md is what the program says of itself. (To mend: candela help-markdown > docs/cli.md)
TEST(Program, CliReferenceIsCurrent) {
  std::ifstream file(test::source_path("docs/cli.md"));
  std::stringstream committed;
  committed << file.rdbuf();
  EXPECT_EQ(run({"help-markdown"}).out, committed.str());
}

// Claim: all threads are used, none twice, every worker has one.
TEST(LocalFarmTest, ThreadsAreSplitEvenly) {
  EXPECT_EQ(split_threads(8, 3), (std::vector<unsigned>{3, 3, 2}));
  EXPECT_EQ(split_threads(2, 2), (std::vector<unsigned>{1, 1}));
  EXPECT_EQ(split_threads(2, 5), (std::vector<unsigned>{1, 1, 1, 1, 1}));
}

// Claim: an unfinished render is neither overwritten nor shared, nothing but our own folder is ever thrown
// away.
TEST(StateFolderTest, ModesAndOwnership) {
  const fs::path path = fs::path(testing::TempDir()) / ("state-" + std::to_string(::getpid()) + ".candela");
  fs::remove_all(path);
  EXPECT_EQ(StateFolder::open(path, StateFolder::Mode::resume).error().exit_code(), 2);
  {
    auto folder = StateFolder::open(path, StateFolder::Mode::create);
    ASSERT_TRUE(folder.ok()) << folder.error().to_string();
    fs::create_directories((*folder)->farm());
    // A second owner is refused even if it would resume.
    EXPECT_EQ(StateFolder::open(path, StateFolder::Mode::resume).error().kind, ErrorKind::refused);
    EXPECT_EQ(StateFolder::open(path, StateFolder::Mode::fresh).error().kind, ErrorKind::refused);
    EXPECT_TRUE(fs::exists((*folder)->farm()));
  }
  const auto again = StateFolder::open(path, StateFolder::Mode::create);
  ASSERT_FALSE(again.ok());
  EXPECT_NE(again.error().to_string().find("--resume"), std::string::npos);
  {
    auto fresh = StateFolder::open(path, StateFolder::Mode::fresh);
    ASSERT_TRUE(fresh.ok());
    EXPECT_FALSE(fs::exists((*fresh)->farm()));
    EXPECT_TRUE((*fresh)->remove().ok());
  }
  EXPECT_FALSE(fs::exists(path));
  // A folder of somebody else's.
  fs::create_directories(path / "farm");
  EXPECT_FALSE(StateFolder::open(path, StateFolder::Mode::fresh).ok());
  EXPECT_TRUE(fs::exists(path / "farm"));
  fs::remove_all(path);
}

}  // namespace
}  // namespace candela::client
