// The instrument itself: on estimators whose error is known, over interruptions, with references that are not
// good enough. Statistical ones state their false-alarm rate; seeds are fixed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numbers>
#include <sstream>

#include "common/base/files.h"
#include "common/image/image.h"
#include "common/rng/stream.h"
#include "tests/bench/candela_bench/process.h"
#include "tests/bench/candela_bench/schedule.h"
#include "tests/bench/candela_bench/truth.h"

namespace candela::bench {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr std::uint32_t kSize = 64;
constexpr std::size_t kValues = std::size_t{kSize} * kSize * 3;
constexpr double kTruth = 0.8;
const std::string kScene = CANDELA_SOURCE_DIR "/deploy/scenes/cornell/scene.xml";

// An image of `kTruth + bias` with normal noise of known variance a unit, whatever the slices; a unit takes
// 1 ms. A scene_file that is "broken" fails at its third unit.
class KnownEstimator final : public Estimator {
 public:
  KnownEstimator(const RunSpec& run, double deviation, double bias)
      : seed_(rng::key(run.job.seed, std::hash<std::string>{}(run.job.integrator))),
        broken_(run.scene == "broken"),
        deviation_(deviation),
        bias_(bias),
        sums_(kValues) {}
  std::string unit_name() const override { return "iterations"; }
  Result<Cost> advance(std::uint64_t units) override {
    for (; cost_.units < units; ++cost_.units) {
      if (broken_ && cost_.units == 2) return failed_error("planted");
      rng::Stream stream(rng::key(seed_, cost_.units));
      for (std::size_t i = 0; i < kValues; i += 2) {
        const double radius = std::sqrt(-2 * std::log(1 - stream.next_double()));
        const double angle = 2 * std::numbers::pi * stream.next_double();
        sums_[i] += radius * std::cos(angle);
        sums_[i + 1] += radius * std::sin(angle);
      }
    }
    cost_.cpu_seconds = 1e-3 * static_cast<double>(cost_.units);
    return cost_;
  }
  Result<Snapshot> snapshot() override {
    Snapshot snapshot;
    for (const double sum : sums_)
      snapshot.image.push_back(
          static_cast<float>(kTruth + bias_ + deviation_ * sum / static_cast<double>(cost_.units)));
    return snapshot;
  }
  Result<std::string> save() override {
    return std::string(reinterpret_cast<const char*>(&cost_), sizeof cost_) +
           std::string(reinterpret_cast<const char*>(sums_.data()), kValues * sizeof(double));
  }
  Result<Cost> restore(std::string_view saved) override {
    if (saved.size() != sizeof cost_ + kValues * sizeof(double)) return input_error("cut short");
    std::memcpy(&cost_, saved.data(), sizeof cost_);
    std::memcpy(sums_.data(), saved.data() + sizeof cost_, kValues * sizeof(double));
    return cost_;
  }

 private:
  std::uint64_t seed_;
  bool broken_;
  double deviation_, bias_;
  std::vector<double> sums_;
  Cost cost_;
};

EstimatorFactory known(double deviation, double bias) {
  return [=](const RunSpec& run) -> Result<std::unique_ptr<Estimator>> {
    return std::unique_ptr<Estimator>(std::make_unique<KnownEstimator>(run, deviation, bias));
  };
}

RunSpec a_run(std::uint64_t seed, const std::string& variant = "known") {
  RunSpec run;
  run.scene = run.scene_file = "nothing";
  run.variant = run.job.integrator = variant;
  run.job.seed = seed;
  run.job.width = run.job.height = kSize;
  return run;
}

// A flat reference; deviation < 0: not known.
ReferenceSource flat_reference(double deviation) {
  const auto reference = std::make_shared<Reference>(
      kSize, kSize, std::vector<float>(kValues, static_cast<float>(kTruth)),
      deviation < 0 ? std::vector<float>() : std::vector<float>(kValues, static_cast<float>(deviation)),
      false);
  return [reference](const std::string&) -> Result<std::shared_ptr<const Reference>> {
    return std::shared_ptr<const Reference>(reference);
  };
}

Schedule iterations(std::uint64_t n) {
  Schedule schedule;
  schedule.budget.iterations = n;
  schedule.budget.slice_seconds = 0.003;
  return schedule;
}

// A folder of its own, gone at the end.
class Folder {
 public:
  Folder() {
    std::string name = (fs::temp_directory_path() / "candela-bench-XXXXXX").string();
    path_ = ::mkdtemp(name.data());
  }
  ~Folder() { fs::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

Store open_store(const fs::path& folder) {
  auto store = Store::open(folder);
  if (!store.ok()) throw std::runtime_error(store.error().to_string());
  return *store;
}

// Each row's relMSE is chi-squared with 12288 degrees of freedom about V / N + B^2, whose relative deviation
// is at most sqrt(2 / 12288) = 1.3 %. Bounds are five of them: 18 rows give a false alarm with 1e-5.
void expect_curve(double deviation, double bias) {
  const std::vector<RunSpec> runs = {a_run(1), a_run(2)};
  const auto results = run_all(runs, iterations(256), known(deviation, bias), flat_reference(0), nullptr);
  ASSERT_EQ(results.size(), 2U);
  for (const RunResult& result : results) {
    ASSERT_EQ(result.rows.size(), 9U);
    for (std::size_t k = 0; k < 9; ++k) {
      const auto n = static_cast<double>(1ULL << k);
      EXPECT_EQ(result.rows[k].cost.units, 1ULL << k);
      const double mse = deviation * deviation / n + bias * bias;
      const double wrong = 5 * std::sqrt(2.0 / kValues);
      const Figures& f = result.rows[k].figures;
      EXPECT_NEAR(f.relmse / (mse / (1.01 * kTruth * kTruth)), 1, wrong) << "after " << n;
      EXPECT_NEAR(f.relmse_fixed / (mse / (kTruth * kTruth + 0.01)), 1, wrong) << "after " << n;
      EXPECT_NEAR(f.rmse * f.rmse / mse, 1, wrong) << "after " << n;
      EXPECT_LT(f.relmse_trimmed, f.relmse);
      EXPECT_EQ(result.rows[k].truth, "good");
    }
  }
}

TEST(Instrument, PureVarianceFallsAsOneOverN) {
  expect_curve(0.3, 0);
}
TEST(Instrument, BiasIsTheFloor) {
  expect_curve(0.3, 0.05);
}

TEST(Instrument, EqualTimeRecordsAtDoublingTimes) {
  Schedule schedule;
  schedule.budget.seconds = 0.2;
  schedule.budget.first_seconds = 0.02;
  schedule.budget.slice_seconds = 0.01;
  const auto results = run_all({a_run(1)}, schedule, known(0.3, 0), flat_reference(0), nullptr);
  std::vector<std::uint64_t> units;
  for (const Row& row : results[0].rows) units.push_back(row.cost.units);
  // A unit takes 1 ms, so points lie within one unit of their time.
  ASSERT_EQ(units.size(), 5U);
  for (std::size_t k = 0; k < 5; ++k)
    EXPECT_NEAR(static_cast<double>(units[k]), std::min(200.0, 20.0 * static_cast<double>(1U << k)), 1.0);
}

TEST(Instrument, Points) {
  EXPECT_EQ(iteration_points(20, 1), (std::vector<std::uint64_t>{1, 2, 4, 8, 16, 20}));
  EXPECT_EQ(iteration_points(1, 1), (std::vector<std::uint64_t>{1}));
  EXPECT_EQ(iteration_points(8, 2), (std::vector<std::uint64_t>{1, 2, 3, 4, 6, 8}));
  EXPECT_EQ(time_points(0.5, 3, 1), (std::vector<double>{0.5, 1, 2, 3}));
  EXPECT_EQ(time_points(0.5, 0.2, 1), (std::vector<double>{0.2}));
}

// Slices of all runs alternate: no run is ever more than the others' slices ahead in time.
TEST(Instrument, RunsTakeTurns) {
  std::vector<std::string> turns;
  class Watched final : public Estimator {
   public:
    Watched(const RunSpec& run, std::vector<std::string>& turns)
        : inner_(run, 0.3, 0), name_(run.variant), turns_(turns) {}
    std::string unit_name() const override { return inner_.unit_name(); }
    Result<Cost> advance(std::uint64_t units) override {
      turns_.push_back(name_);
      return inner_.advance(units);
    }
    Result<Snapshot> snapshot() override { return inner_.snapshot(); }
    Result<std::string> save() override { return inner_.save(); }
    Result<Cost> restore(std::string_view saved) override { return inner_.restore(saved); }

   private:
    KnownEstimator inner_;
    std::string name_;
    std::vector<std::string>& turns_;
  };
  const EstimatorFactory factory = [&](const RunSpec& run) -> Result<std::unique_ptr<Estimator>> {
    return std::unique_ptr<Estimator>(std::make_unique<Watched>(run, turns));
  };
  (void)run_all({a_run(1, "a"), a_run(1, "b")}, iterations(64), factory, flat_reference(0), nullptr);
  ASSERT_GT(turns.size(), 20U);
  for (std::size_t i = 0; i < turns.size(); ++i) EXPECT_EQ(turns[i], i % 2 == 0 ? "a" : "b");
}

TEST(Instrument, AFailureIsOneRunsOwn) {
  RunSpec broken = a_run(1);
  broken.scene = "broken";
  const auto results = run_all({broken, a_run(2)}, iterations(8), known(0.3, 0), flat_reference(0), nullptr);
  ASSERT_TRUE(results[0].error.has_value());
  EXPECT_EQ(results[0].error->message, "planted");
  EXPECT_EQ(results[0].rows.size(), 2U);
  EXPECT_FALSE(results[1].error.has_value());
  EXPECT_EQ(results[1].rows.size(), 4U);
}

// What does not depend on the clock.
std::vector<std::vector<double>> figures_of(const std::vector<RunResult>& results) {
  std::vector<std::vector<double>> all;
  for (const RunResult& result : results)
    for (const Row& row : result.rows)
      all.push_back({static_cast<double>(row.cost.units), row.figures.relmse, row.figures.rmse,
                     row.figures.smape, row.cost.cpu_seconds});
  return all;
}

TEST(Instrument, GoesOnWhereRowsAreMissing) {
  const Folder folder;
  const std::vector<RunSpec> runs = {a_run(1), a_run(2)};
  const auto whole = run_all(runs, iterations(64), known(0.3, 0.01), flat_reference(0), nullptr);
  std::atomic<bool> stop{false};
  int rows = 0;
  Schedule schedule = iterations(64);
  schedule.stop = &stop;
  schedule.say = [&](const std::string&) { stop = ++rows == 5; };
  const Store store = open_store(folder.path());
  const auto cut = run_all(runs, schedule, known(0.3, 0.01), flat_reference(0), &store);
  ASSERT_LT(figures_of(cut).size(), 14U);
  const auto rest = run_all(runs, iterations(64), known(0.3, 0.01), flat_reference(0), &store);
  EXPECT_EQ(figures_of(rest), figures_of(whole));

  // What is finished is not started again: a factory that fails is not even asked.
  const EstimatorFactory none = [](const RunSpec&) -> Result<std::unique_ptr<Estimator>> {
    return failed_error("asked");
  };
  const auto again = run_all(runs, iterations(64), none, flat_reference(0), &store);
  EXPECT_EQ(figures_of(again), figures_of(whole));
  for (const RunResult& result : again) EXPECT_FALSE(result.error.has_value());

  // More iterations: only those that are missing.
  const auto more = run_all(runs, iterations(128), known(0.3, 0.01), flat_reference(0), &store);
  EXPECT_EQ(figures_of(more),
            figures_of(run_all(runs, iterations(128), known(0.3, 0.01), flat_reference(0), nullptr)));

  // A state that is gone or cut short: the run begins again.
  for (const auto& entry : fs::directory_iterator(folder.path() / "runs"))
    if (entry.path().extension() == ".state") fs::resize_file(entry.path(), 10);
  const auto anew = run_all(runs, iterations(256), known(0.3, 0.01), flat_reference(0), &store);
  EXPECT_EQ(figures_of(anew),
            figures_of(run_all(runs, iterations(256), known(0.3, 0.01), flat_reference(0), nullptr)));
}

TEST(Instrument, RefusesRowsOfAnotherBuild) {
  const Folder folder;
  const Store store = open_store(folder.path());
  std::ofstream(folder.path() / "runs" / "x.json") << R"({"build_id": "another", "state": "", "rows": []})";
  const auto refused = Store::open(folder.path());
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().to_string(), HasSubstr("another"));
  std::ofstream(folder.path() / "runs" / "x.json") << "{";
  EXPECT_FALSE(Store::open(folder.path()).ok());
}

// The reference's own squared error is 1e-4, the measured one 0.09 / N + 1e-4: the factor 10 is kept up to
// N = 64 and no longer.
TEST(Instrument, MarksRowsWhoseReferenceIsTooNoisy) {
  const auto results = run_all({a_run(1)}, iterations(256), known(0.3, 0.01), flat_reference(0.01), nullptr);
  for (const Row& row : results[0].rows) {
    EXPECT_EQ(row.truth, row.cost.units <= 64 ? "good" : "noisy") << row.cost.units;
    EXPECT_NEAR(row.reference_factor / (1 + 900.0 / static_cast<double>(row.cost.units)), 1, 0.15);
  }
  const auto unknown = run_all({a_run(1)}, iterations(4), known(0.3, 0), flat_reference(-1), nullptr);
  for (const Row& row : unknown[0].rows) EXPECT_EQ(row.truth, "unknown");
}

TEST(Instrument, CsvAndJsonSayTheSame) {
  EXPECT_EQ(csv_line({"a", "b,c", "d\"e", "f\ng", ""}), "a,\"b,c\",\"d\"\"e\",\"f\ng\",\n");
  const Folder folder;
  const Store store = open_store(folder.path());
  RunSpec run = a_run(1);
  run.scene_file = "/a, \"b\"/it's.xml";
  (void)run_all({run}, iterations(4), known(0.3, 0), flat_reference(0.01), &store);
  ASSERT_TRUE(store.collect().ok());
  const auto csv = read_file(folder.path() / "rows.csv", 1 << 20);
  const auto json = read_file(folder.path() / "rows.json", 1 << 20);
  ASSERT_TRUE(csv.ok() && json.ok());
  EXPECT_EQ(std::count(csv->begin(), csv->end(), '\n'), 4);
  EXPECT_EQ(csv->substr(0, csv->find('\n') + 1), csv_line(columns()));
  // The command is one that a shell reads back: the quotes of the path are quoted, then those of CSV doubled.
  EXPECT_THAT(*csv, HasSubstr("--scene '/a, \"\"b\"\"/it'\\''s.xml'"));
  EXPECT_THAT(*json, HasSubstr("\"units\": 4"));
  for (const std::string& column : columns()) EXPECT_THAT(*json, HasSubstr('"' + column + '"'));
}

// --- lists ---

std::string error_of_list(const std::string& text) {
  const Folder folder;
  const std::string file = (folder.path() / "list.toml").string();
  std::ofstream(file) << text;
  RunOptions options;
  options.list = file;
  const auto work = prepare(options);
  return work.ok() ? "" : work.error().to_string();
}

TEST(Lists, BadOnesHaveOneClearError) {
  EXPECT_THAT(error_of_list("iterations = "), HasSubstr("list.toml:1"));
  EXPECT_THAT(error_of_list("iterations = 4\niteratoins = 4\n"), HasSubstr(":2: unknown key 'iteratoins'"));
  EXPECT_THAT(error_of_list("iterations = 4\n"), HasSubstr("no [[scene]]"));
  EXPECT_THAT(error_of_list("iterations = \"many\"\n"), HasSubstr(":1: 'iterations' cannot be this"));
  EXPECT_THAT(error_of_list("[[scene]]\nfile = \"a\"\n"), HasSubstr("'reference' is missing"));
  EXPECT_THAT(error_of_list("[[scene]]\nfile = \"a\"\nreference = \"b\"\n[[run]]\nintegrator = \"path\"\n"),
              HasSubstr("either --iterations or --time"));
  EXPECT_THAT(error_of_list("time = 1\n[[scene]]\nfile = \"a\"\nreference = \"no.exr\"\n"
                            "[[run]]\nintegrator = \"path\"\n"),
              HasSubstr("no.exr"));
}

TEST(Lists, MakeRunsOfAllCombinations) {
  const Folder folder;
  const std::vector<float> black(16 * 8 * 3);
  const auto exr = image::encode_exr(16, 8, black, {});
  ASSERT_TRUE(exr.ok());
  ASSERT_TRUE(write_file_atomically(folder.path() / "truth.exr", *exr).ok());
  std::ofstream(folder.path() / "list.toml")
      << "iterations = 4\nseeds = [3, 4]\n[[scene]]\nreference = \"truth.exr\"\nfile = \"" << kScene
      << "\"\n[[run]]\nintegrator = \"path\"\n[[run]]\nintegrator = \"path\"\nname = \"short\"\n"
         "set = { max_depth = 2 }\n";
  RunOptions options;
  options.list = (folder.path() / "list.toml").string();
  const auto work = prepare(options);
  ASSERT_TRUE(work.ok()) << work.error().to_string();
  ASSERT_EQ(work->runs.size(), 4U);
  for (const RunSpec& run : work->runs) {
    EXPECT_EQ(run.scene, "cornell");
    EXPECT_EQ(run.job.width, 16U);
    const auto back = RunSpec::from_json(run.to_json());
    ASSERT_TRUE(back.ok());
    EXPECT_EQ(back->id(), run.id());
  }
  EXPECT_EQ(work->runs[1].job.integrator_settings.at("max_depth"), "2");
  EXPECT_EQ(command_of(work->runs[1], 4, true).substr(0, 21), "candela-bench run --s");
  EXPECT_THAT(command_of(work->runs[1], 4, true), HasSubstr("--set max_depth=2 --seed 3 --iterations 4"));

  // The row's command leads to the same run.
  RunOptions command;
  command.scenes = {work->runs[1].scene_file};
  command.reference = work->runs[1].reference;
  command.integrators = {"path"};
  command.sets = {"max_depth=2"};
  command.seeds = {3};
  command.iterations = 4;
  const auto single = prepare(command);
  ASSERT_TRUE(single.ok()) << single.error().to_string();
  EXPECT_EQ(single->runs[0].job.integrator_settings, work->runs[1].job.integrator_settings);
  EXPECT_EQ(single->runs[0].scene_hash, work->runs[1].scene_hash);
}

// --- rendering in other processes ---

RunSpec small_render(const std::string& integrator) {
  auto run = make_run(kScene, "cornell", integrator, {}, 24, 24);
  if (!run.ok()) throw std::runtime_error(run.error().to_string());
  run->job.seed = 5;
  return *run;
}

TEST(Rendering, SlicesAndProcessesChangeNoBit) {
  for (const char* integrator : {"path", "ppm"}) {
    const RunSpec run = small_render(integrator);
    auto here = make_render_estimator(run);
    auto there = make_process_estimator(CANDELA_BINARY_DIR "/candela-bench", run);
    ASSERT_TRUE(here.ok() && there.ok());
    ASSERT_TRUE((*here)->advance(7).ok());
    for (const std::uint64_t units : {1, 2, 5}) ASSERT_TRUE((*there)->advance(units).ok());
    // Kept, and gone on with by another process.
    const auto saved = (*there)->save();
    ASSERT_TRUE(saved.ok());
    auto third = make_process_estimator(CANDELA_BINARY_DIR "/candela-bench", run);
    ASSERT_TRUE(third.ok());
    const auto restored = (*third)->restore(*saved);
    ASSERT_TRUE(restored.ok()) << restored.error().to_string();
    EXPECT_EQ(restored->units, 5U);
    const auto cost = (*third)->advance(7);
    ASSERT_TRUE(cost.ok());
    EXPECT_EQ((*here)->snapshot()->image, (*third)->snapshot()->image);
    EXPECT_GT(cost->rays, 24U * 24 * 7);
    EXPECT_EQ(cost->eye_samples, 24U * 24 * 7);
    EXPECT_GT(cost->cpu_seconds, 0);
    EXPECT_GT(cost->delta_bytes, 0U);
    EXPECT_GT(cost->peak_memory_bytes, 1U << 20);
    // Of another run: refused.
    RunSpec other = run;
    other.job.width = 16;
    auto fourth = make_process_estimator(CANDELA_BINARY_DIR "/candela-bench", other);
    EXPECT_FALSE((*fourth)->restore(*saved).ok());
  }
}

TEST(Rendering, AProcessSaysWhatIsWrong) {
  RunSpec run = small_render("path");
  run.job.integrator = "pth";
  const auto wrong = make_process_estimator(CANDELA_BINARY_DIR "/candela-bench", run);
  ASSERT_FALSE(wrong.ok());
  EXPECT_THAT(wrong.error().to_string(), HasSubstr("unknown integrator 'pth'"));
  EXPECT_FALSE(make_process_estimator("/nowhere/candela-bench", run).ok());
}

// --- references ---

TruthOptions truth_options(const fs::path& out) {
  TruthOptions options;
  options.scene_file = kScene;
  options.width = options.height = kSize;
  options.integrators = {"path", "bdpt"};
  options.iterations = 256;
  options.batches = 8;
  options.out = out.string();
  return options;
}

// Two estimators of one image with deviations 0.3 and 0.1 a unit: together, weighted by inverse variance, 256
// units each have a variance of 1 / (256 / 0.09 + 256 / 0.01). The measured relMSE has a relative deviation
// of sqrt(2 / 12288) = 1.3 %, the one estimated from 8 batches of 0.5 %; 8 % is six of the larger: 1e-8.
TEST(Truth, CombinesTwoThatAgree) {
  const Folder folder;
  const EstimatorFactory factory = [](const RunSpec& run) {
    return known(run.job.integrator == "path" ? 0.3 : 0.1, 0)(run);
  };
  const auto options = truth_options(folder.path() / "truth.exr");
  std::atomic<bool> stop{false};
  const auto made = make_truth(options, factory, stop, [](const std::string&) {});
  ASSERT_TRUE(made.ok()) << made.error().to_string();
  const auto reference = Reference::read(options.out, false);
  ASSERT_TRUE(reference.ok());
  const double expected = 1 / (256 / 0.09 + 256 / 0.01) / (1.01 * kTruth * kTruth);
  const auto truth = flat_reference(0)("");
  EXPECT_NEAR((*truth)->figures_of((*reference)->rgb()).relmse / expected, 1, 0.08);
  ASSERT_TRUE((*reference)->own_error().has_value());
  EXPECT_NEAR((*reference)->own_error()->relmse / expected, 1, 0.08);
}

TEST(Truth, RefusedWhereTwoDisagree) {
  const Folder folder;
  // 2 % too bright: 20 standard errors of the whole image.
  const EstimatorFactory factory = [](const RunSpec& run) {
    return known(0.3, run.job.integrator == "path" ? 0.016 : 0)(run);
  };
  const auto options = truth_options(folder.path() / "truth.exr");
  std::atomic<bool> stop{false};
  const auto refused = make_truth(options, factory, stop, [](const std::string&) {});
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().to_string(), HasSubstr("disagree"));
  EXPECT_FALSE(fs::exists(options.out));
}

TEST(Truth, GoesOnAfterAStop) {
  const Folder folder;
  const auto options = truth_options(folder.path() / "truth.exr");
  std::atomic<bool> stop{false};
  int batches = 0;
  const auto cut =
      make_truth(options, known(0.3, 0), stop, [&](const std::string&) { stop = ++batches == 3; });
  ASSERT_FALSE(cut.ok());
  stop = false;
  batches = 0;
  const auto made = make_truth(options, known(0.3, 0), stop, [&](const std::string&) { ++batches; });
  ASSERT_TRUE(made.ok()) << made.error().to_string();
  EXPECT_EQ(batches, 13);  // of 16
}

// --- figures ---

TEST(FlipFigure, IsZeroForEqualAndOneForGreenAgainstBlue) {
  std::vector<float> green, blue, noise;
  rng::Stream stream(7);
  for (int p = 0; p < 40 * 30; ++p) {
    green.insert(green.end(), {0, 1, 0});
    blue.insert(blue.end(), {0, 0, 1});
    for (int c = 0; c < 3; ++c) noise.push_back(stream.next_float());
  }
  for (const float value : ldr_flip(noise, noise, 40, 30)) EXPECT_EQ(value, 0);
  for (const float value : ldr_flip(green, blue, 40, 30)) EXPECT_NEAR(value, 1, 1e-3);
  const Flip hdr(noise, 40, 30);
  EXPECT_EQ(hdr.mean(noise), 0);
  std::vector<float> broken = noise;
  broken[17] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_GT(hdr.mean(broken), 0);
  EXPECT_LE(hdr.mean(blue), 1);
  const Flip black(std::vector<float>(40 * 30 * 3, 0.0F), 40, 30);
  EXPECT_GT(black.mean(noise), 0.1);
}

TEST(FiguresOf, BrokenPixelsAreInfinitelyWrong) {
  const auto reference = *flat_reference(0)("");
  std::vector<float> image = reference->rgb();
  EXPECT_EQ(reference->figures_of(image).relmse, 0);
  EXPECT_EQ(reference->figures_of(image).smape, 0);
  image[0] = std::numeric_limits<float>::infinity();
  const Figures figures = reference->figures_of(image);
  EXPECT_TRUE(std::isinf(figures.relmse) && std::isinf(figures.rmse));
  EXPECT_NEAR(figures.smape, 2.0 / kValues, 1e-12);
}

}  // namespace
}  // namespace candela::bench
