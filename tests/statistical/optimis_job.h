// Jobs of optimis for tests: units are rendered and merged through the bytes of a delta, and images are read
// by any estimator. Batches are ranges of indices with independent random numbers.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "common/film/delta.h"
#include "common/film/development.h"
#include "common/stages/development.h"
#include "common/stages/developments/optimal_mis.h"
#include "tests/proofs/proofs.h"
#include "tests/statistical/harness.h"
#include "tests/statistical/quantiles.h"
#include "worker/integrators/unit_data.h"

namespace candela::statistical {

constexpr std::uint32_t kExtent = 64;
constexpr std::size_t kBatches = 16;

inline TestScene load(const std::string& name, const std::string& integrator, const SettingsMap& settings) {
  TestScene scene = scene_from_transport(name, kExtent, kExtent);
  scene.settings.sampler = "independent";
  return with_integrator(std::move(scene), integrator, settings);
}

// The merged sums of one job.
struct Merged {
  film::MergedFilm film;
  std::array<std::vector<film::MergedAccumulator>, 2> sums;  // [half][accumulator]

  const film::MergedAccumulator* find(std::string_view name, std::uint32_t half) const {
    for (const film::MergedAccumulator& a : sums[half])
      if (a.spec().name == name) return &a;
    return nullptr;
  }
};

class Job {
 public:
  Job(const std::string& scene, const std::string& integrator, const SettingsMap& settings)
      : Job(load(scene, integrator, settings)) {}
  explicit Job(TestScene scene) : scene_(std::move(scene)), renderer_(make_renderer(scene_)) {
    auto pilot = renderer_->pilot({});
    if (!pilot.ok()) throw std::runtime_error(pilot.error().to_string());
    pilot_ = std::move(*pilot);
    proofs::fact("plan of " + identity(scene_), pilot_.plan);
  }
  const WorkPlan& work() const { return pilot_.work; }
  const std::string& plan() const { return pilot_.plan; }
  film::Layout layout() const { return {kExtent, kExtent, 1}; }

  Merged empty() const {
    Merged m{film::MergedFilm(layout(), pilot_.state.film_scale_log2), {}};
    for (auto& half : m.sums)
      for (const film::AccumulatorSpec& spec : work().accumulators) half.emplace_back(kExtent, kExtent, spec);
    return m;
  }
  // Renders indices [begin, end) of a half and merges them, through the bytes of a delta.
  void merge(Merged& into, std::uint32_t half, std::uint64_t begin, std::uint64_t end, unsigned threads = 2) {
    if (proofs::probing()) return merge_probe(into, half, begin, end);
    proofs::film(identity(scene_), {});
    auto output = renderer_->make_output(pilot_.state);
    render::RunContext run;
    run.threads = threads;
    const Unit unit{Unit::Kind::iterations, half, begin, end};
    const auto done = renderer_->run(unit, {pilot_.state, {}, {}}, output, run);
    ASSERT_TRUE(done.ok()) << done.error().to_string();
    const std::string bytes = integrators::encode_delta({unit, {}, 0, "j", "b"}, output);
    const auto delta = film::Delta::decode(bytes, {layout(), work().accumulators});
    ASSERT_TRUE(delta.ok()) << delta.error().to_string();
    ASSERT_TRUE(into.film.merge(*delta).ok());
    for (std::size_t i = 0; i < delta->accumulators().size(); ++i)
      into.sums[half][i].merge(delta->accumulators()[i].sums);
    for (const std::uint64_t rejected : into.film.sample_counts(half).rejected) EXPECT_EQ(rejected, 0U);
  }
  std::vector<float> image(const Merged& m, std::string_view estimator) const {
    film::Development development;
    if (work().development) {
      const DevelopmentInput input{
          *work().development, estimator, kExtent, kExtent,
          [&](std::string_view name, std::uint32_t half) { return m.find(name, half); }};
      auto corrections = correct(input);
      if (!corrections.ok()) throw std::runtime_error(corrections.error().to_string());
      for (std::size_t half = 0; half < 2; ++half)
        if (!(*corrections)[half].empty())
          development.corrections[half] =
              std::make_shared<const std::vector<float>>(std::move((*corrections)[half]));
    }
    return film::develop_image(m.film, development);
  }
  // Independent images of `iterations` in each half.
  Rows rows(std::string_view estimator, std::uint64_t iterations, const Regions& regions) {
    Rows out;
    for (std::size_t b = 0; b < kBatches; ++b) {
      Merged m = empty();
      for (const std::uint32_t half : {0U, 1U}) merge(m, half, b * iterations, (b + 1) * iterations);
      const std::vector<float> rgb = image(m, estimator);
      out.push_back(regions.means(std::vector<double>(rgb.begin(), rgb.end())));
    }
    return out;
  }

 private:
  // One unit of few iterations for each half, which takes the place of all others.
  void merge_probe(Merged& into, std::uint32_t half, std::uint64_t begin, std::uint64_t end) {
    std::string& bytes = probes_[half];
    if (bytes.empty()) {
      auto output = renderer_->make_output(pilot_.state);
      const Unit unit{Unit::Kind::iterations, half, begin, begin + std::min<std::uint64_t>(end - begin, 2)};
      const auto done = renderer_->run(unit, {pilot_.state, {}, {}}, output, {});
      if (!done.ok()) throw std::runtime_error(done.error().to_string());
      proofs::film(identity(scene_), {output.film->sums(), output.film->layout().pixel_count() * 3});
      bytes = integrators::encode_delta({unit, {}, 0, "j", "b"}, output);
    }
    const auto delta = film::Delta::decode(bytes, {layout(), work().accumulators});
    if (!delta.ok()) throw std::runtime_error(delta.error().to_string());
    static_cast<void>(into.film.merge(*delta));  // refused if it is there already
    auto& sums = into.sums[half];
    for (std::size_t i = 0; i < delta->accumulators().size(); ++i) {
      sums[i].merge(delta->accumulators()[i].sums);
      proofs::fact("sums of " + identity(scene_), sums[i].serialise());
    }
  }

  TestScene scene_;
  std::unique_ptr<render::Renderer> renderer_;
  PilotResult pilot_;
  std::array<std::string, 2> probes_;  // deltas by half
};

// Over the image, of a group of lights: for each technique the mean of S_r,i - W / M, and the number of
// samples.
struct Controls {
  std::vector<double> excess;
  double samples = 0;
};
inline Controls controls_of(const Job& job, const Merged& m, std::size_t group = 0) {
  const film::AccumulatorSpec& matrix = job.work().accumulators.at(2 * group);
  std::size_t n = 1;
  while (mis::packed_size(n) < matrix.channels) ++n;
  mis::Sums sums;
  for (std::uint32_t y = 0; y < kExtent; ++y)
    for (std::uint32_t x = 0; x < kExtent; ++x)
      for (std::uint32_t i = 0; i < matrix.channels; ++i)
        sums.a[i] +=
            static_cast<double>(m.sums[0][2 * group].sum(x, y, i)) * std::ldexp(1.0, -matrix.scale_log2);
  const mis::Allocation allocation = mis::Allocation::ones(n);
  const mis::Vector r = sums.control_sums(allocation);
  Controls out;
  out.samples = sums.samples(allocation);
  for (std::size_t i = 0; i < n; ++i)
    out.excess.push_back((r[i] - out.samples / static_cast<double>(n)) / (kExtent * kExtent));
  return out;
}

// t test of each technique's mean against 0 at 6e-7: t > 8.25 with 15 degrees of freedom. Returns the number
// of tests. batches: [batch][technique], kBatches of them.
inline std::size_t expect_zero_means(const std::vector<std::vector<double>>& batches,
                                     const std::string& what) {
  const std::size_t techniques = batches.at(0).size();
  for (std::size_t i = 0; i < techniques; ++i) {
    double sum = 0, squares = 0;
    for (const auto& v : batches) {
      sum += v[i];
      squares += v[i] * v[i];
    }
    const double mean = sum / kBatches,
                 error = std::sqrt(std::max(0.0, squares / kBatches - mean * mean) / (kBatches - 1));
    EXPECT_LE(std::abs(mean), 8.25 * error + 1e-6) << what << ", technique " << i;
  }
  return techniques;
}

// Welch tests of all values at 1e-6 together (Bonferroni). Values that are too skewed or do not vary are left
// out. Returns the number of tests.
inline std::size_t expect_same_means(const Rows& a, const Rows& b, const Regions& regions,
                                     const std::string& what) {
  std::size_t tested = 0;
  for (std::size_t v = 0; v < regions.values(); ++v) {
    const Welch w = welch(a, b, v);
    if (!(w.deviation > 0) || std::max(w.skewness_a, w.skewness_b) > 2) continue;
    const double limit =
        student_quantile(1e-6 / 2 / static_cast<double>(regions.values()), w.freedom) * w.deviation;
    EXPECT_LE(std::abs(w.mean_a - w.mean_b), limit) << what << " " << regions.name(v);
    ++tested;
  }
  return tested;
}

}  // namespace candela::statistical
