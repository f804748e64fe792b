// Shared by the tests of the instrument: an estimator whose error is known, and a folder to write to.
#pragma once

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <functional>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "common/rng/stream.h"
#include "tests/bench/candela_bench/schedule.h"
#include "tests/paths.h"

namespace candela::bench {

namespace fs = std::filesystem;

inline constexpr std::uint32_t kSize = 64;
inline constexpr std::size_t kValues = std::size_t{kSize} * kSize * 3;
inline constexpr double kTruth = 0.8;
inline const std::string kScene = test::source_path("deploy/scenes/cornell/scene.xml");

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

inline EstimatorFactory known(double deviation, double bias) {
  return [=](const RunSpec& run) -> Result<std::unique_ptr<Estimator>> {
    return std::unique_ptr<Estimator>(std::make_unique<KnownEstimator>(run, deviation, bias));
  };
}

inline RunSpec a_run(std::uint64_t seed, const std::string& variant = "known") {
  RunSpec run;
  run.scene = run.scene_file = "nothing";
  run.variant = run.job.integrator = variant;
  run.job.seed = seed;
  run.job.width = run.job.height = kSize;
  return run;
}

// A flat reference; deviation < 0: not known.
inline ReferenceSource flat_reference(double deviation) {
  const auto reference = std::make_shared<Reference>(
      kSize, kSize, std::vector<float>(kValues, static_cast<float>(kTruth)),
      deviation < 0 ? std::vector<float>() : std::vector<float>(kValues, static_cast<float>(deviation)),
      false);
  return [reference](const std::string&) -> Result<std::shared_ptr<const Reference>> {
    return std::shared_ptr<const Reference>(reference);
  };
}

inline Schedule iterations(std::uint64_t n) {
  Schedule schedule;
  schedule.budget.iterations = n;
  schedule.budget.slice_seconds = 0.003;
  return schedule;
}

}  // namespace candela::bench
