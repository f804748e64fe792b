// The instrument itself: on estimators whose error is known, over interruptions, with references that are not
// good enough. Statistical ones state their false-alarm rate; seeds are fixed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "common/base/files.h"
#include "tests/bench/known_estimator.h"
#include "tests/temporary_folder.h"

namespace candela::bench {
namespace {

using testing::HasSubstr;

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

// Columns that do not depend on the clock.
std::vector<std::vector<double>> figures_of(const std::vector<RunResult>& results) {
  std::vector<std::vector<double>> all;
  for (const RunResult& result : results)
    for (const Row& row : result.rows)
      all.push_back({static_cast<double>(row.cost.units), row.figures.relmse, row.figures.rmse,
                     row.figures.smape, row.cost.cpu_seconds});
  return all;
}

TEST(Instrument, GoesOnWhereRowsAreMissing) {
  const test::TemporaryFolder folder;
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

  // A finished run is not started again: a factory that fails is not even asked.
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

// Rows are judged by the factor that is asked for last, finished runs too.
TEST(Instrument, JudgesKeptRowsAgain) {
  const test::TemporaryFolder folder;
  const Store store = open_store(folder.path());
  const auto truths = [&](double factor) {
    Schedule schedule = iterations(64);
    schedule.reference_factor = factor;
    (void)run_all({a_run(1)}, schedule, known(0.3, 0.01), flat_reference(0.01), &store);
    const auto kept = store.read(a_run(1));
    if (!kept.ok()) throw std::runtime_error(kept.error().to_string());
    std::string first_letters;
    for (const Row& row : kept->rows) first_letters += row.truth[0];
    return first_letters;
  };
  // The factor is about 1 + 900 / N.
  EXPECT_EQ(truths(10), "ggggggg");
  EXPECT_EQ(truths(100), "ggggnnn");
  ASSERT_TRUE(store.collect().ok());
  EXPECT_THAT(*read_file(folder.path() / "rows.csv", 1 << 20), HasSubstr("--reference-factor 100"));
  EXPECT_EQ(truths(10), "ggggggg");
}

TEST(Instrument, RefusesAnotherRunOfOneName) {
  const test::TemporaryFolder folder;
  const Store store = open_store(folder.path());
  (void)run_all({a_run(1)}, iterations(4), known(0.3, 0), flat_reference(0), &store);
  EXPECT_TRUE(store.check_names({a_run(1), a_run(2), a_run(1, "b")}).ok());
  for (const auto change : std::vector<void (*)(RunSpec&)>{
           [](RunSpec& run) { run.job.integrator_settings["max_depth"] = "12"; },
           [](RunSpec& run) { run.threads = 2; }, [](RunSpec& run) { run.scene_hash = "another"; },
           [](RunSpec& run) { run.reference_hash = "another"; }}) {
    RunSpec other = a_run(1);
    change(other);
    other.job.seed = 2;  // whatever the seed
    const auto refused = store.check_names({other});
    ASSERT_FALSE(refused.ok());
    EXPECT_THAT(refused.error().to_string(), HasSubstr("rows of nothing with known of another "));
    other.scene = "something";
    EXPECT_TRUE(store.check_names({other}).ok());
  }
}

TEST(Instrument, OneProcessAFolder) {
  const test::TemporaryFolder folder;
  const Store store = open_store(folder.path());
  EXPECT_TRUE(store.lock().ok());
  const auto refused = store.lock();
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().to_string(), HasSubstr("another candela-bench works in this folder"));
}

TEST(Instrument, RefusesRowsOfAnotherBuild) {
  const test::TemporaryFolder folder;
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
  const test::TemporaryFolder folder;
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

}  // namespace
}  // namespace candela::bench
