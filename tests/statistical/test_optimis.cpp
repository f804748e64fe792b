// optimis in the full renderer: the expectation of its controls, its image against that of `path`, and what
// threads and units may not change. Batches are ranges of indices with independent random numbers.
//
// Each comparison is a t test of 16 batches at 1e-6 or less (t > 7.5 with 15 degrees of freedom, or
// Bonferroni over the values of an image); there are fewer than 60 of them: a false alarm for other seeds
// with at most 1e-4.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "common/bundle/bundle.h"
#include "common/film/delta.h"
#include "common/film/development.h"
#include "common/stages/development.h"
#include "common/stages/developments/optimal_mis.h"
#include "tests/statistical/harness.h"
#include "tests/statistical/quantiles.h"
#include "worker/integrators/unit_data.h"

namespace candela::statistical {
namespace {

constexpr std::uint32_t kExtent = 64;
constexpr std::size_t kBatches = 16;

TestScene load(const std::string& name, const std::string& integrator, const SettingsMap& settings) {
  TestScene scene;
  scene.files = std::make_shared<bundle::DiskSource>(CANDELA_SOURCE_DIR "/tests/statistical/transport");
  scene.main_key = name + ".xml";
  scene = read_scene(std::move(scene), kExtent, kExtent);
  scene.settings.sampler = "independent";
  return with_integrator(std::move(scene), integrator, settings);
}

// What is merged of one job.
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
    auto output = renderer_->make_output(pilot_.state);
    render::RunContext run;
    run.threads = threads;
    const Unit unit{Unit::Kind::iterations, half, begin, end};
    const auto done = renderer_->run(unit, {}, output, run);
    ASSERT_TRUE(done.ok()) << done.error().to_string();
    const std::string bytes = integrators::encode_delta({unit, {}, 0, "j", "b"}, output);
    const auto delta = film::Delta::decode(bytes, {layout(), work().accumulators});
    ASSERT_TRUE(delta.ok()) << delta.error().to_string();
    ASSERT_TRUE(into.film.merge(*delta).ok());
    for (std::size_t i = 0; i < delta->accumulators().size(); ++i)
      into.sums[half][i].merge(delta->accumulators()[i].sums);
    for (const std::uint64_t rejected : into.film.tallies(half).rejected) EXPECT_EQ(rejected, 0U);
  }
  std::vector<float> image(const Merged& m, std::string_view estimator) const {
    film::Development development;
    if (work().development) {
      auto corrections =
          correct({*work().development, estimator, kExtent, kExtent,
                   [&](std::string_view name, std::uint32_t half) { return m.find(name, half); }});
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
  TestScene scene_;
  std::unique_ptr<render::Renderer> renderer_;
  PilotResult pilot_;
};

const SettingsMap kEverything = {
    {"selection", "contribution,power,uniform"}, {"plan", "full"}, {"max_depth", "4"}};

// Over the image: for each technique the mean of S_r,i - W / M, and the number of samples.
struct Controls {
  std::vector<double> excess;
  double samples = 0;
};
Controls controls_of(const Job& job, const Merged& m) {
  const film::AccumulatorSpec& matrix = job.work().accumulators.at(0);
  std::size_t n = 1;
  while (mis::packed_size(n) < matrix.channels) ++n;
  mis::Sums sums;
  for (std::uint32_t y = 0; y < kExtent; ++y)
    for (std::uint32_t x = 0; x < kExtent; ++x)
      for (std::uint32_t i = 0; i < matrix.channels; ++i)
        sums.a[i] += static_cast<double>(m.sums[0][0].sum(x, y, i)) * std::ldexp(1.0, -matrix.scale_log2);
  const mis::Allocation allocation = mis::Allocation::ones(n);
  const mis::Vector r = sums.control_sums(allocation);
  Controls out;
  out.samples = sums.samples(allocation);
  for (std::size_t i = 0; i < n; ++i)
    out.excess.push_back((r[i] - out.samples / static_cast<double>(n)) / (kExtent * kExtent));
  return out;
}

// Claim: each control has the expectation 1 for each batch, whatever is between vertices and whichever lights
// there are, and the matrix counts whole samples.
TEST(Optimis, ControlsHaveExpectationOne) {
  // With plan=full the bsdf's control never varies, as where surfaces let light pass straight.
  SettingsMap automatic = kEverything;
  automatic["plan"] = "auto";
  std::vector<std::pair<std::string, SettingsMap>> cases;
  for (const char* scene : {"many-lamps", "box-diffuse", "envmap", "constant", "textured-lamp", "mixed",
                            "mask", "smoke", "point", "spot", "mirror-room", "mesh-lamp"})
    cases.emplace_back(scene, kEverything);
  for (const char* scene : {"many-lamps", "box-diffuse", "envmap", "constant", "textured-lamp", "mesh-lamp"})
    cases.emplace_back(scene, automatic);
  for (const auto& [scene, settings] : cases) {
    Job job(scene, "optimis", settings);
    ASSERT_EQ(job.work().accumulators.size(), 2U) << scene;
    std::vector<std::vector<double>> values;
    for (std::size_t b = 0; b < kBatches; ++b) {
      Merged m = job.empty();
      job.merge(m, 0, b * 2, (b + 1) * 2);
      const Controls c = controls_of(job, m);
      EXPECT_NEAR(c.samples, std::nearbyint(c.samples), 1e-4) << scene;
      values.push_back(c.excess);
    }
    for (std::size_t i = 0; i < values[0].size(); ++i) {
      double sum = 0, squares = 0;
      for (const auto& v : values) {
        sum += v[i];
        squares += v[i] * v[i];
      }
      const double mean = sum / kBatches,
                   error = std::sqrt(std::max(0.0, squares / kBatches - mean * mean) / (kBatches - 1));
      EXPECT_LE(std::abs(mean), 7.5 * error + 1e-6) << scene << ", technique " << i;
    }
  }
}

// Claim: the image by crossfit is that of `path`; so is the balance heuristic's, of the same job.
TEST(Optimis, AgreesWithPath) {
  const Regions regions(kExtent, kExtent, 16);
  const SettingsMap depth = {{"max_depth", "4"}};
  const std::uint64_t kIterations = long_form() ? 16 : 4;  // of a half
  for (const char* scene : {"many-lamps", "envmap", "mixed", "mask", "smoke", "mirror-glossy"}) {
    Job path(scene, "path", depth), optimis(scene, "optimis", kEverything);
    const Rows expected = path.rows({}, kIterations, regions);
    for (const std::string_view estimator : {"crossfit", "balance"}) {
      const Rows rows = optimis.rows(estimator, kIterations, regions);
      for (std::size_t v = 0; v < regions.values(); ++v) {
        const Welch w = welch(rows, expected, v);
        if (!(w.deviation > 0) || std::max(w.skewness_a, w.skewness_b) > 2) continue;
        const double limit =
            student_quantile(1e-6 / 2 / static_cast<double>(regions.values()), w.freedom) * w.deviation;
        EXPECT_LE(std::abs(w.mean_a - w.mean_b), limit)
            << scene << " " << estimator << " " << regions.name(v);
      }
    }
  }
}

// Claim: with one technique, sample for sample, and with two and the balance heuristic, within rounding of
// floats, the film is that of `path`.
TEST(Optimis, IsPathWithItsTechniques) {
  const auto film_of = [](const char* scene, const char* integrator, const SettingsMap& settings) {
    Job job(scene, integrator, settings);
    Merged m = job.empty();
    job.merge(m, 1, 0, 4);
    return m.film.develop(0);
  };
  for (const char* scene : {"point", "spot", "directional"})
    EXPECT_EQ(film_of(scene, "optimis", {{"selection", "contribution"}}), film_of(scene, "path", {}))
        << scene;
  for (const char* scene : {"many-lamps", "box-diffuse", "envmap", "smoke"}) {
    const auto a = film_of(scene, "optimis",
                           {{"selection", "contribution"}, {"weights", "balance"}, {"max_depth", "2"}});
    const auto b = film_of(scene, "path", {{"heuristic", "balance"}, {"max_depth", "2"}});
    for (std::size_t i = 0; i < a.size(); ++i)
      ASSERT_NEAR(a[i], b[i], 1e-4 * std::abs(b[i]) + 1e-5) << scene << " " << i;
  }
}

// Claim: sums and images are the same bits with one thread and four, and however the iterations are cut into
// units and in whichever order they are merged.
TEST(Optimis, UnitsAndThreadsChangeNothing) {
  Job job("many-lamps", "optimis", kEverything);
  Merged whole = job.empty(), cut = job.empty();
  for (const std::uint32_t half : {0U, 1U}) job.merge(whole, half, 0, 6, 1);
  for (const std::uint32_t half : {1U, 0U}) {
    job.merge(cut, half, 4, 6, 4);
    job.merge(cut, half, 0, 1, 3);
    job.merge(cut, half, 1, 4, 2);
  }
  for (std::uint32_t half = 0; half < 2; ++half)
    for (std::size_t i = 0; i < 2; ++i)
      EXPECT_EQ(whole.sums[half][i].serialise(), cut.sums[half][i].serialise());
  for (const std::string_view estimator : optimal_mis::kEstimators)
    EXPECT_EQ(job.image(whole, estimator), job.image(cut, estimator));
}

// A strong lamp that a screen hides from the whole floor, and two weak ones that it does not hide.
constexpr const char* kHiddenLamp = R"(<scene version="3.0.0">
  <sensor type="perspective"><float name="fov" value="40"/>
    <transform name="to_world"><lookat origin="0, 2, 0" target="0, 0, 0" up="0, 0, 1"/></transform></sensor>
  <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="2"/></transform>
    <bsdf type="diffuse"/></shape>
  <shape type="rectangle"><transform name="to_world"><scale value="0.1"/><rotate x="1" angle="90"/>
    <translate x="0" y="5" z="0"/></transform><emitter type="area"><rgb name="radiance" value="200"/></emitter></shape>
  <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><scale value="1.5"/>
    <translate x="0" y="4.5" z="0"/></transform><bsdf type="diffuse"/></shape>
  <shape type="rectangle"><transform name="to_world"><scale value="0.1"/><rotate x="1" angle="90"/>
    <translate x="1.5" y="2.5" z="0"/></transform><emitter type="area"><rgb name="radiance" value="20"/></emitter></shape>
  <shape type="rectangle"><transform name="to_world"><scale value="0.1"/><rotate x="1" angle="90"/>
    <translate x="-1.5" y="2.5" z="0.5"/></transform><emitter type="area"><rgb name="radiance" value="15"/></emitter></shape>
</scene>)";

// Claim: where the selections send many samples to a lamp that is hidden, optimal weights lower the squared
// error to less than half of the balance heuristic's; direct weights too.
TEST(Optimis, GainsWhereALampIsHidden) {
  TestScene scene = scene_from_xml(kHiddenLamp, kExtent, kExtent);
  scene.settings.sampler = "independent";
  Job job(with_integrator(std::move(scene), "optimis",
                          {{"techniques", "light"}, {"selection", "contribution,power,uniform"}}));
  Merged m = job.empty(), reference = job.empty();
  for (const std::uint32_t half : {0U, 1U}) {
    job.merge(m, half, 0, 32);
    job.merge(reference, half, 1000, 1256);
  }
  const std::vector<float> truth = job.image(reference, "crossfit");
  const auto error = [&](std::string_view estimator) {
    const std::vector<float> image = job.image(m, estimator);
    double sum = 0;
    for (std::size_t i = 0; i < image.size(); ++i)
      sum += std::pow(static_cast<double>(image[i]) - static_cast<double>(truth[i]), 2);
    return sum;
  };
  const double balance = error("balance");
  for (const char* estimator : {"crossfit", "direct"}) {
    const double ratio = error(estimator) / balance;
    std::printf("squared error of %s over that of balance, 64 iterations: %.3f\n", estimator, ratio);
    EXPECT_LT(ratio, 0.5) << estimator;
  }
}

// Claim: the plan says which techniques run and why not the others.
TEST(Optimis, PlanSaysWhy) {
  const Job one("box-diffuse", "optimis", {}), point("point", "optimis", {}),
      many("many-lamps", "optimis", {});
  EXPECT_NE(one.plan().find("there is one emitter"), std::string::npos) << one.plan();
  EXPECT_NE(point.plan().find("one technique needs no weights"), std::string::npos) << point.plan();
  EXPECT_FALSE(point.work().development);
  EXPECT_NE(many.plan().find("3 techniques, 240 bytes of sums a pixel"), std::string::npos) << many.plan();
}

}  // namespace
}  // namespace candela::statistical
