// Every heuristic and estimator of multiple importance sampling on integrals whose variances are known
// [Kondapaneni 2019, supplement, Fig. 1 and section 3; problems of mis_case.h].
//
// Part "variance": of one batch, by quadrature. Part "convergence": bias, and variance and squared error
// times the number of batches, from many runs of the estimators of common/mis; "ridge 0" has none. Bias and
// its standard error are of the difference from the estimate with exact slopes on the same samples. Part
// "regression": how far Owen and Zhou's regression is from the direct estimator. Part "fan": [Fan 2006] with
// batches of four samples of each of two techniques. The maps are weights at the points that MisCase::shown
// has, and what they are made of.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "tests/bench/candela_study/mis_case.h"
#include "tests/bench/candela_study/mis_regression.h"
#include "tests/bench/candela_study/study.h"
#include "tests/mis_estimators.h"
#include "tests/mis_problems.h"
#include "tests/statistical/moments.h"

namespace candela::study {
namespace {

using statistical::Moments;

constexpr int kDoublings = 7;   // up to 128 batches
constexpr int kSumsScale = 40;  // of sums that were not rounded: a ridge for rounding far below any noise
constexpr int kFanBatch = 4;    // samples of each technique
constexpr std::uint64_t kFanWord = 0x66616e;

// ---- weights

void add_weights(const MisCase& problem, const MisExact& exact, Results& results) {
  const auto height = static_cast<std::uint32_t>(problem.shown.size() / problem.shown_width);
  const auto add = [&](const std::string& what, const auto& value) {
    Map& map = results.maps.emplace_back(Map{problem.name + ", " + what, problem.shown_width, height, {}});
    for (const MisPoint& point : problem.shown) map.values.push_back(static_cast<float>(value(point)));
  };
  add("f", [](const MisPoint& point) { return point.f; });
  for (std::size_t i = 0; i < problem.allocation.techniques; ++i) {
    add(fmt::format("p{}", i + 1), [&](const MisPoint& point) { return point.p[i]; });
    for (const std::string strategy : kMisStrategies) {
      if (strategy == "best, all samples" || (height > 1 && strategy != "balance" && strategy != "optimal"))
        continue;
      add(fmt::format("{} w{}", strategy, i + 1), [&](const MisPoint& point) {
        return point.f > 0 ? weights_at(problem, exact, strategy, point)[i] : 0;
      });
    }
  }
}

void add_variances(const MisCase& problem, const MisExact& exact, std::vector<Row>& rows) {
  const auto add = [&](const std::string& method, const std::string& quantity, double value, double error) {
    rows.push_back({"variance", problem.name, method, kNone, kNone, quantity, value, error});
  };
  add("", "integral", exact.integral, 0);
  for (std::size_t i = 0; i < problem.allocation.techniques; ++i)
    add("optimal", fmt::format("alpha {}", i + 1), exact.alpha[i], 0);
  const bool line = problem.name.find(' ') == std::string::npos || problem.name.starts_with("L1");
  for (const std::string strategy : kMisStrategies)
    // Weights of these two jump along lines that the quadrature in two dimensions does not know.
    add(strategy, "variance", exact_variance(problem, exact, strategy),
        line || (strategy != "cutoff" && strategy != "maximum") ? 0 : kNone);
}

// ---- convergence

struct Estimate {
  const char* method;
  double value;
};

double estimate(const mis::Allocation& n, const mis::Sums& sums, double correction, double batches) {
  return (sums.balance_sum(n, 0) + correction) / batches;
}

// Sums of batches of kFanBatch samples of each technique, for an allocation that says so: all c shrink.
mis::Sums grouped(mis::Sums sums) {
  constexpr double kFactor = 1.0 / (kFanBatch * kFanBatch);
  for (double& a : sums.a) a *= kFactor;
  for (mis::Vector& b : sums.b)
    for (double& value : b) value *= kFactor;
  return sums;
}
mis::Allocation grouped(mis::Allocation allocation) {
  for (double& count : allocation.counts) count *= kFanBatch;
  return allocation;
}

// One run: estimates after 1, 2, 4, ... batches. Epochs end there.
class Run {
 public:
  Run(const MisCase& problem, const mis::Slopes& exact, std::uint64_t key)
      : problem_(problem), n_(problem.allocation), exact_(exact), random_(key) {}

  // Draws until there are 2^doubling batches. Call with 0, 1, 2, ...
  std::vector<Estimate> advance(int doubling) {
    const int until = 1 << doubling;
    mis::Sums epoch;
    for (; batches_ < until; ++batches_) epoch.add(draw_batch());
    const mis::Sums first = all_;  // of two halves, from two batches on
    epochs_.push_back(epoch);
    all_.add(epoch);
    const double count = until;
    std::vector<Estimate> out;
    const auto add = [&](const char* method, double correction) {
      out.push_back({method, estimate(n_, all_, correction, count)});
    };
    add("exact alpha", mis::correction(n_, all_, exact_)[0]);
    add("balance", 0);
    add("direct, ridge 0", mis::correction(n_, all_, mis::solve(n_, all_, 0))[0]);
    add("direct", mis::direct(n_, std::span(&all_, 1), kSumsScale)[0]);
    add("crossfit", until < 2 ? 0 : mis::crossfit(n_, first, epoch, kSumsScale)[0]);
    add("progressive", mis::progressive(n_, epochs_, kSumsScale)[0]);
    if (until >= kFanBatch) out.push_back({"fan", fan_sum_ / (count / kFanBatch)});
    return out;
  }
  const std::vector<MisSample>& samples() const { return samples_; }

 private:
  mis::Sums draw_batch() {
    const std::size_t begin = samples_.size();
    problem_.draw(random_, samples_);
    mis::Sums batch;
    for (std::size_t k = begin; k < samples_.size(); ++k)
      batch.add(n_.techniques, samples_[k].c, {samples_[k].f_over_q, 0, 0});
    fan_group_.add(batch);
    if ((batches_ + 1) % kFanBatch == 0) {
      fan_sum_ += fan(grouped(n_), grouped(fan_group_), n_.techniques);
      fan_group_ = {};
    }
    return batch;
  }

  const MisCase& problem_;
  const mis::Allocation& n_;
  const mis::Slopes& exact_;
  rng::Stream random_;
  std::vector<MisSample> samples_;
  std::vector<mis::Sums> epochs_;
  mis::Sums all_, fan_group_;
  double fan_sum_ = 0;
  int batches_ = 0;
};

struct Errors {
  Moments error, squared, beyond_exact;
};

void add_convergence(const MisCase& problem, const MisExact& exact, std::uint64_t word, std::uint64_t runs,
                     std::vector<Row>& rows) {
  mis::Slopes slopes{};
  slopes[0] = exact.alpha;
  std::vector<std::vector<std::pair<std::string, Errors>>> found(kDoublings + 1);
  for (std::uint64_t seed = 1; seed <= runs; ++seed) {
    Run run(problem, slopes, rng::key(seed, word));
    for (int doubling = 0; doubling <= kDoublings; ++doubling) {
      const std::vector<Estimate> estimates = run.advance(doubling);
      auto& all = found[static_cast<std::size_t>(doubling)];
      if (seed == 1)
        for (const Estimate& e : estimates) all.push_back({e.method, {}});
      for (std::size_t k = 0; k < estimates.size(); ++k) {
        const double error = estimates[k].value - exact.integral;
        all[k].second.error.add(error);
        all[k].second.squared.add(error * error);
        all[k].second.beyond_exact.add(estimates[k].value - estimates[0].value);
      }
    }
  }
  for (int doubling = 0; doubling <= kDoublings; ++doubling)
    for (const auto& [method, errors] : found[static_cast<std::size_t>(doubling)]) {
      const double batches = 1 << doubling;
      const auto add = [&, m = method](const std::string& quantity, double value, double error) {
        rows.push_back({"convergence", problem.name, m, kNone, batches, quantity, value, error});
      };
      add("bias", errors.beyond_exact.mean(), errors.beyond_exact.error());
      add("variance x batches", errors.error.variance() * batches, kNone);
      add("squared error x batches", errors.squared.mean() * batches, errors.squared.error() * batches);
    }
}

// The largest difference of any run, relative to the integral.
void add_regression(const MisCase& problem, const MisExact& exact, std::uint64_t word, std::uint64_t runs,
                    std::vector<Row>& rows) {
  mis::Slopes slopes{};
  slopes[0] = exact.alpha;
  constexpr int kRegressed = 5;  // up to 32 batches
  std::vector<double> largest(kRegressed + 1);
  for (std::uint64_t seed = 1; seed <= runs; ++seed) {
    Run run(problem, slopes, rng::key(seed, word));
    for (int doubling = 0; doubling <= kRegressed; ++doubling) {
      double direct = 0;
      for (const Estimate& e : run.advance(doubling))
        if (std::string_view(e.method) == "direct, ridge 0") direct = e.value;
      if (doubling < 3) continue;  // too few samples to tell the rank of all problems
      double& difference = largest[static_cast<std::size_t>(doubling)];
      const double off = owen_zhou(problem.allocation, run.samples()) - direct;
      difference = std::max(difference, std::abs(off) / exact.integral);
    }
  }
  for (int doubling = 3; doubling <= kRegressed; ++doubling)
    rows.push_back({"regression", problem.name, "Owen-Zhou", kNone, static_cast<double>(1 << doubling),
                    "largest difference from direct", largest[static_cast<std::size_t>(doubling)], 0});
}

// ---- fan

// The first two techniques of a problem, with kFanBatch samples of each in a batch. Relative to the integral.
void add_fan(const std::string& name, std::uint64_t runs, std::vector<Row>& rows) {
  test::MisProblem both = test::mis_problem(name);
  both.techniques.resize(2);
  both.allocation = grouped(mis::Allocation::ones(2));
  const MisCase problem = line_case(both);
  const MisExact exact = exact_of(problem);
  const auto add = [&](const std::string& method, const Moments& found) {
    rows.push_back({"fan", name, method, kNone, kNone, "relative bias", found.mean() / exact.integral - 1,
                    found.error() / exact.integral});
    rows.push_back({"fan", name, method, kNone, kNone, "variance", found.variance(), kNone});
  };
  std::array<Moments, 3> without;  // by the column left out
  Moments direct;
  std::vector<MisSample> samples;
  for (std::uint64_t seed = 1; seed <= runs; ++seed) {
    rng::Stream random(rng::key(seed, kFanWord));
    samples.clear();
    problem.draw(random, samples);
    mis::Sums batch;
    for (const MisSample& sample : samples) batch.add(2, sample.c, {sample.f_over_q, 0, 0});
    for (std::size_t dropped = 0; dropped < without.size(); ++dropped)
      without[dropped].add(fan(problem.allocation, batch, dropped));
    direct.add(
        estimate(problem.allocation, batch,
                 mis::correction(problem.allocation, batch, mis::solve(problem.allocation, batch, 0))[0], 1));
  }
  add("without the intercept", without[0]);
  add("without p1", without[1]);
  add("without p2", without[2]);
  add("direct, ridge 0", direct);
  rows.push_back(
      {"fan", name, "optimal", kNone, kNone, "variance", exact_variance(problem, exact, "optimal"), 0});
}

}  // namespace

Result<Results> run_mis_1d(const Request& request) {
  Results results;
  const std::uint64_t runs = request.short_form ? 400 : 20000, regressions = request.short_form ? 10 : 200;
  std::uint64_t word = 0;  // of the random numbers
  for (const MisCase& problem : mis_cases()) {
    const MisExact exact = exact_of(problem);
    add_weights(problem, exact, results);
    add_variances(problem, exact, results.rows);
    add_convergence(problem, exact, ++word, runs, results.rows);
    add_regression(problem, exact, word, regressions, results.rows);
    request.say("mis-1d: " + problem.name);
  }
  for (const char* name : {"D1", "D2", "D5"})
    add_fan(name, request.short_form ? 20000 : 400000, results.rows);
  return results;
}

}  // namespace candela::study
