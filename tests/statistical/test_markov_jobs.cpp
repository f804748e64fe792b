// Jobs of chains as a whole: threads, cuts, what starts of chains do to the mean, and scenes at the edge of
// what there is.
//
// Where a claim is statistical its test says with which probability it alarms falsely for new seeds.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <thread>

#include "tests/integrators.h"
#include "tests/proofs/proofs.h"
#include "tests/statistical/chain_driver.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"MarkovJobs.StartsLeaveNoTrace", "MarkovJobs.TheErrorOfBIsRight",
                                  "MarkovJobs.RareLightIsFoundOrTheJobIsBlack",
                                  "MarkovJobs.ASinglePixelIsAFilm", "MarkovJobs.PathsOfAThousandEdges"});

struct Method {
  std::string name;
  SettingsMap settings;
};
const std::vector<Method>& methods() {
  static const std::vector<Method> all = {
      {"pssmlt", {{"over", "bdpt"}}}, {"pssmlt", {{"over", "path"}}}, {"mmlt", {}}};
  return all;
}
ChainJob job_of(const TestScene& scene, const Method& method, const SettingsMap& more) {
  SettingsMap settings = method.settings;
  for (const auto& [name, value] : more) settings[name] = value;
  ChainJob job;
  job.scene = with_integrator(scene, method.name, settings);
  return job;
}

double luminance_of(const std::vector<double>& image) {
  double sum = 0;
  for (std::size_t i = 0; i < image.size(); i += 3)
    sum += 0.212671 * image[i] + 0.715160 * image[i + 1] + 0.072169 * image[i + 2];
  return sum / static_cast<double>(image.size() / 3);
}

// Claim: the film, the chains' records and the sample counts are the same to the last bit whatever the
// threads, with direct light by either way.
TEST(MarkovJobs, ThreadsChangeNothing) {
  const TestScene scene = scene_from_transport("mixed", 40, 24);
  for (const Method& method : methods()) {
    for (const char* direct : {"chain", "path"}) {
      SCOPED_TRACE(method.name + " " + direct);
      ChainJob job = job_of(
          scene, method, {{"chains", "18"}, {"bootstrap", "3000"}, {"mutations", "2"}, {"direct", direct}});
      job.rounds = 2;
      const ChainImage one = render_chains(job, 5);
      EXPECT_GT(one.b.b, 0);
      for (const unsigned threads : {2U, 7U}) {
        job.threads = threads;
        const ChainImage many = render_chains(job, 5);
        EXPECT_EQ(many.sums, one.sums);
        EXPECT_EQ(many.records, one.records);
        EXPECT_EQ(many.sample_counts, one.sample_counts);
        EXPECT_EQ(many.b.b, one.b.b);
      }
    }
  }
}

render::UnitOutput bootstrap(const render::Renderer& renderer, std::uint64_t begin, std::uint64_t end,
                             const render::RunContext& run) {
  render::UnitOutput output;
  const auto done = renderer.run({Unit::Kind::bootstrap, 0, begin, end}, {}, output, run);
  EXPECT_TRUE(done.ok());
  return output;
}

// Claim: a unit cut into smaller ones, rendered in another order, gives the same film and the same records.
TEST(MarkovJobs, CutsOfUnitsChangeNothing) {
  const TestScene scene = scene_from_transport("box-diffuse", 32, 32);
  TestScene chained = with_integrator(
      scene, "pssmlt", {{"chains", "16"}, {"bootstrap", "1000"}, {"mutations", "2"}, {"direct", "path"}});
  chained.settings.seed = 3;
  const auto renderer = make_renderer(chained);
  const render::RunContext run{2};
  const std::vector<float> contributions = bootstrap(*renderer, 0, 1000, run).table;
  const std::vector<float> later = bootstrap(*renderer, 700, 1000, run).table;
  std::vector<float> in_parts = bootstrap(*renderer, 0, 700, run).table;
  in_parts.insert(in_parts.end(), later.begin(), later.end());
  EXPECT_EQ(contributions, in_parts);
  chains::BootstrapTable table(1000);
  ASSERT_TRUE(table.insert(0, contributions).ok());
  const auto chosen = table.choose_starts(16, 3);
  NamedState state;
  state.bootstrap_b = table.normalisation().b;
  state.film_scale_log2 = chains::film_scale_log2(state.bootstrap_b, 0);
  std::vector<chains::ChainStart> starts;
  for (std::uint64_t i = 0; i < 8; ++i) starts.push_back({chosen[2 * i + 1], {}});
  auto whole = renderer->make_output(state), cut = renderer->make_output(state);
  ASSERT_TRUE(renderer->run({Unit::Kind::segments, 1, 0, 8}, {state, {}, starts}, whole, run).ok());
  const std::span<const chains::ChainStart> all(starts);
  ASSERT_TRUE(renderer->run({Unit::Kind::segments, 1, 3, 8}, {state, {}, all.subspan(3)}, cut, run).ok());
  const std::vector<chains::ChainRecord> last = cut.records;
  ASSERT_TRUE(renderer->run({Unit::Kind::segments, 1, 0, 3}, {state, {}, all.subspan(0, 3)}, cut, run).ok());
  std::vector<chains::ChainRecord> joined = cut.records;
  joined.insert(joined.end(), last.begin(), last.end());
  EXPECT_EQ(joined, whole.records);
  const std::size_t values = whole.film->layout().pixel_count() * 3 * 2;
  EXPECT_TRUE(std::equal(whole.film->sums(), whole.film->sums() + values, cut.film->sums()));
  // A record of another segment is refused, not rendered.
  EXPECT_EQ(renderer->run({Unit::Kind::segments, 1, 8, 16}, {state, {}, starts}, cut, run).error().kind,
            ErrorKind::input);
}

// Claim: chains show no trace of where they started. Thousands of jobs whose chains make four mutations each
// have the mean of `path`, at every quarter of the picture, within 1.5 % of it and four standard errors. The
// chains' starts are drawn from their own estimate of b, which makes each mutation's expectation right from
// the first on, but for terms of the order of (variance of a sample) / (bootstrap samples), here 17 / 2048,
// times a factor below 1 (docs/normalisation.md). Alarms falsely with probability below 1e-3: 36 values at
// four standard errors beyond 1.5 %.
TEST(MarkovJobs, StartsLeaveNoTrace) {
  const TestScene scene = scene_from_transport("box-diffuse", 16, 16);
  const Regions regions(16, 16, 8);
  BatchPlan plan;
  plan.seed = 1ULL << 32;
  plan.iterations = 2048;
  const Rows right = render_rows({{1.0, with_integrator(scene, "path")}}, plan, regions, 1, 1);
  const int jobs = long_form() ? 20000 : 1000;
  for (const Method& method : methods()) {
    // Starts are drawn by the farm, the same for all methods: the short form leaves the slowest out.
    if (!long_form() && &method == &methods()[0]) continue;
    SCOPED_TRACE(method.name);
    ChainJob job = job_of(scene, method, {{"chains", "64"}, {"bootstrap", "2048"}, {"mutations", "1"}});
    Rows rows(jobs);
    std::atomic<int> next{0};
    {
      const auto work = [&] {
        for (int i = next++; i < jobs; i = next++)
          rows[static_cast<std::size_t>(i)] = regions.means(
              render_chains(job, (std::uint64_t{7} << 32) + static_cast<std::uint64_t>(i)).image);
      };
      // The probe's one image is that of the first job, whichever thread would be the first.
      std::vector<std::jthread> threads;
      for (int i = 0; i < (proofs::probing() ? 1 : 2); ++i) threads.emplace_back(work);
    }
    double largest = 0;
    for (std::size_t value = 0; value < regions.values(); ++value) {
      const Welch w = welch(rows, right, value);
      const double off = std::abs(w.mean_a / w.mean_b - 1);
      largest = std::max(largest, off);
      EXPECT_LT(w.deviation, 0.015 * w.mean_b) << "not precise enough";
      EXPECT_LE(std::abs(w.mean_a - w.mean_b), 0.015 * w.mean_b + 4 * w.deviation)
          << regions.name(value) << ": " << w.mean_a << " against " << w.mean_b;
      if (regions.whole(value))
        std::printf("%s %s: %s off by %+.3f %% +- %.3f %%\n", method.name.c_str(),
                    method.settings.empty() ? "" : method.settings.at("over").c_str(),
                    regions.name(value).c_str(), 100 * (w.mean_a / w.mean_b - 1),
                    100 * w.deviation / w.mean_b);
    }
    std::printf("largest difference of a region: %.3f %%\n", 100 * largest);
  }
}

// Claim: b's stated error is right: over 200 seeds the pooled b is within 1.96 of its standard errors of the
// long-run value in about 95 % of jobs. Fewer than 174 or all 200 would be 5 sigma off: probability below
// 1e-5. (Rare bright samples make the interval somewhat too narrow: some per cent.) One stage: with two, each
// job has an importance of the film of its own, and a b for it.
TEST(MarkovJobs, TheErrorOfBIsRight) {
  const TestScene scene = scene_from_transport("box-diffuse", 16, 16);
  ChainJob job =
      job_of(scene, methods()[1],
             {{"chains", "8"}, {"bootstrap", "20000"}, {"mutations", "4"}, {"two_stage", "false"}});
  std::vector<chains::Normalisation> estimates;
  double mean = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    estimates.push_back(render_chains(job, 100 + seed).b);
    mean += estimates.back().b / 200;
  }
  const auto covered = std::count_if(
      estimates.begin(), estimates.end(),
      [&](const chains::Normalisation& one) { return std::abs(one.b - mean) < 1.96 * one.standard_error; });
  std::printf("covered: %td of 200\n", covered);
  EXPECT_GT(covered, 174);
  EXPECT_LT(covered, 200);
}

const std::string kDark = R"(
<scene version="3.0.0"><integrator type="path"/>
  <sensor type="perspective"><float name="fov" value="60"/></sensor>
  <shape type="sphere"><point name="center" x="0" y="0" z="4"/></shape>
</scene>)";

// Claim: a scene without light is black, and no error: b is 0, chains stand still, segments count.
TEST(MarkovJobs, ABlackSceneIsBlack) {
  const TestScene scene = scene_from_xml(kDark, 8, 8);
  for (const Method& method : methods()) {
    for (const char* direct : {"chain", "path"}) {
      const ChainImage result = render_chains(
          job_of(scene, method, {{"chains", "4"}, {"bootstrap", "500"}, {"direct", direct}}), 1);
      EXPECT_EQ(result.b.b, 0);
      EXPECT_EQ(result.b.samples, 500u);
      for (const double v : result.image) EXPECT_EQ(v, 0);
      for (const auto& record : result.records) EXPECT_EQ(record.segments, 1u);
    }
  }
}

// Claim: where one bootstrap sample in 10^6 carries light (a lamp that covers as much of the film, seen
// directly alone) a job is right where it finds any, and says zero where it does not: b0 = 0 and a black
// picture, never an error.
TEST(MarkovJobs, RareLightIsFoundOrTheJobIsBlack) {
  const std::string xml = R"(
<scene version="3.0.0"><integrator type="path"/>
  <sensor type="perspective"><float name="fov" value="90"/></sensor>
  <shape type="sphere"><point name="center" x="0.1" y="0.1" z="4"/><float name="radius" value="0.00451"/>
    <emitter type="area"><rgb name="radiance" value="5"/></emitter></shape>
</scene>)";
  const TestScene scene = scene_from_xml(xml, 16, 16);
  for (const Method& method : methods()) {
    int found = 0;
    for (std::uint64_t seed = 0; seed < 6; ++seed) {
      const ChainImage result = render_chains(
          job_of(scene, method,
                 {{"chains", "16"}, {"bootstrap", "200000"}, {"max_depth", "1"}, {"mutations", "64"}}),
          seed);
      for (const double v : result.image) ASSERT_TRUE(std::isfinite(v) && v >= 0);
      if (result.b0.b == 0) {
        EXPECT_EQ(luminance_of(result.image), 0);
        continue;
      }
      ++found;
      // All that there is is b; the chains know no more than the samples do.
      EXPECT_NEAR(luminance_of(result.image), result.b.b, 0.35 * result.b.b) << seed;
    }
    std::printf("%s: found by %d of 6\n", method.name.c_str(), found);
    EXPECT_LT(found, 6);
  }
}

// Claim: a film of one pixel is a film.
TEST(MarkovJobs, ASinglePixelIsAFilm) {
  const TestScene scene = scene_from_transport("box-diffuse", 1, 1);
  BatchPlan plan;
  plan.iterations = 100000;
  plan.batches = 4;
  const auto right = render_images({{1.0, with_integrator(scene, "path")}}, plan);
  for (const Method& method : methods()) {
    const ChainImage result = render_chains(
        job_of(scene, method, {{"chains", "16"}, {"bootstrap", "100000"}, {"mutations", "20000"}}), 2);
    // b has a standard error of 1.5 % or less; five of them.
    EXPECT_NEAR(result.image[1] / static_cast<double>(right[0][1]), 1, 0.08) << method.name;
  }
}

// Claim: with max_depth 1000 a furnace (radiance (1 - a^1000) / (1 - a) = 10 for albedo a = 0.9) is rendered,
// by mmlt too, which chooses lengths one by one; and no chain's state is too large.
TEST(MarkovJobs, PathsOfAThousandEdges) {
  const std::string xml = R"(
<scene version="3.0.0"><integrator type="path"/>
  <sensor type="perspective"><float name="fov" value="60"/></sensor>
  <shape type="sphere"><float name="radius" value="10"/><boolean name="flip_normals" value="true"/>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.9,0.9,0.9"/></bsdf>
    <emitter type="area"><rgb name="radiance" value="1"/></emitter></shape>
</scene>)";
  const TestScene scene = scene_from_xml(xml, 4, 4);
  for (const Method& method : methods()) {
    const ChainImage result = render_chains(
        job_of(scene, method,
               {{"chains", "16"}, {"bootstrap", "20000"}, {"mutations", "2000"}, {"max_depth", "1000"}}),
        3);
    std::printf("%s: %.3f, b %.3f +- %.3f\n", method.name.c_str(), luminance_of(result.image), result.b.b,
                result.b.standard_error);
    EXPECT_NEAR(luminance_of(result.image), 10, 1.0) << method.name;
    std::size_t largest = 0;
    for (const auto& record : result.records) largest = std::max(largest, record.state.size());
    EXPECT_LE(largest, chains::kMaxStateBytes);
  }
}

// Claim: NaN and infinite contributions, wherever they appear, are counted by their cause and change neither
// b nor the chains: the image stays finite.
TEST(MarkovJobs, SpoiltSamplesAreQuarantined) {
  TestScene scene = with_integrator(scene_from_transport("box-diffuse", 16, 16), "pssmlt",
                                    {{"chains", "4"}, {"bootstrap", "2000"}, {"mutations", "16"}});
  const auto renderer = make_renderer(scene);
  render::RunContext run;
  run.fault = [](std::uint64_t key, float* rgb) {
    if (key % 64 == 0) rgb[1] = NAN;
    if (key % 64 == 1) rgb[0] = INFINITY;
    if (key % 64 == 2) rgb[2] = -1;
  };
  const render::UnitOutput samples = bootstrap(*renderer, 0, 2000, run);
  const std::vector<float>& contributions = samples.table;
  const auto spoilt = [](const film::SampleCounts& t) {
    return std::min({t.rejected[0], t.rejected[1], t.rejected[2]});
  };
  EXPECT_GT(spoilt(samples.counts), 5u);
  chains::BootstrapTable table(2000);
  ASSERT_TRUE(table.insert(0, contributions).ok());
  NamedState state;
  state.bootstrap_b = table.normalisation().b;
  state.film_scale_log2 = chains::film_scale_log2(state.bootstrap_b, 0);
  const auto chosen = table.choose_starts(4, 0);
  const std::vector<chains::ChainStart> starts = {{chosen[0], {}}, {chosen[2], {}}};
  auto output = renderer->make_output(state);
  ASSERT_TRUE(renderer->run({Unit::Kind::segments, 0, 0, 2}, {state, {}, starts}, output, run).ok());
  EXPECT_GT(spoilt(output.sample_counts()), 5u);
  for (const auto& record : output.records) {
    EXPECT_TRUE(std::isfinite(record.counts.large_sum));
    EXPECT_NEAR(record.counts.large_sum / static_cast<double>(record.counts.large_steps), state.bootstrap_b,
                state.bootstrap_b);
  }
}

// Claim: a stop is obeyed within a tenth of a second or little more though a segment takes much longer, and
// progress grows meanwhile.
TEST(MarkovJobs, StopsWithinASegment) {
  TestScene scene = with_integrator(scene_from_transport("box-diffuse", 512, 512), "pssmlt",
                                    {{"chains", "2"}, {"bootstrap", "100"}, {"mutations", "1000"}});
  const auto renderer = make_renderer(scene);
  const std::vector<float> contributions = bootstrap(*renderer, 0, 100, {}).table;
  NamedState state;
  state.bootstrap_b = 1;
  const auto start = std::max_element(contributions.begin(), contributions.end()) - contributions.begin();
  const std::vector<chains::ChainStart> starts = {{static_cast<std::uint64_t>(start), {}}};
  auto output = renderer->make_output(state);
  std::atomic<bool> stop{false};
  std::atomic<float> progress{0};
  std::chrono::steady_clock::time_point asked;
  std::jthread impatient([&] {
    while (progress.load() == 0) std::this_thread::yield();
    asked = std::chrono::steady_clock::now();
    stop = true;
  });
  const auto result =
      renderer->run({Unit::Kind::segments, 0, 0, 1}, {state, {}, starts}, output, {1, &stop, &progress});
  const auto ended = std::chrono::steady_clock::now();
  impatient.join();
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().kind, ErrorKind::refused);
  EXPECT_LT(std::chrono::duration<double>(ended - asked).count(), 0.5);  // a busy machine
  EXPECT_LT(progress.load(), 0.5f);
}

// Claim: the plan says where chains cannot gain anything and why, and names the techniques left out of mmlt's
// choice; and the pilot tells what the farm has to know.
TEST(MarkovJobs, PlansSayWhatChainsAreFor) {
  const auto plan_of = [](const TestScene& scene, const std::string& integrator) {
    return make_renderer(with_integrator(scene, integrator))->plan_text().value();
  };
  const TestScene sky = scene_from_transport("constant", 8, 8), glass = scene_from_transport("caustic", 8, 8);
  for (const std::string& integrator : test::chain_integrators()) {
    EXPECT_NE(plan_of(sky, integrator).find("skip a gain by Metropolis"), std::string::npos)
        << plan_of(sky, integrator);
    EXPECT_NE(plan_of(glass, integrator).find("use  Metropolis: light may be hard to find"),
              std::string::npos)
        << plan_of(glass, integrator);
  }
  EXPECT_NE(plan_of(glass, "mmlt").find("skip light that meets the lens (t = 0)"), std::string::npos);
  const auto pilot =
      make_renderer(with_integrator(glass, "mmlt", {{"chains", "30"}, {"mutations", "5"}}))->pilot({});
  ASSERT_TRUE(pilot.ok());
  ASSERT_TRUE(pilot->work.chains.has_value());
  EXPECT_EQ(pilot->work.chains->chains, 30u);
  EXPECT_EQ(pilot->work.chains->segment_mutations, 11u);  // 8 * 8 * 5 / 30, rounded up
  EXPECT_EQ(pilot->work.chains->bootstrap_samples, 100000u);
  EXPECT_EQ(pilot->work.layers, std::vector<std::string>{"independent"});
  EXPECT_GT(pilot->seconds_per_iteration, 0);
}

// Claim: settings that cannot be, and came by without being completed, are refused by the renderer too, with
// the field.
TEST(MarkovJobs, OddNumbersOfChainsAreRefused) {
  TestScene scene = scene_from_transport("box-diffuse", 8, 8);
  for (const std::string& integrator : test::chain_integrators()) {
    for (const auto& [name, value] : SettingsMap{{"chains", "7"}, {"step_least", "0.1"}}) {
      TestScene wrong = with_integrator(scene, integrator);
      wrong.settings.integrator_settings[name] = value;
      const auto renderer = render::Renderer::create(*wrong.files, wrong.main_key, {}, wrong.settings, 1);
      ASSERT_FALSE(renderer.ok());
      EXPECT_EQ(renderer.error().kind, ErrorKind::usage);
      EXPECT_EQ(renderer.error().field, name);
    }
  }
}

}  // namespace
}  // namespace candela::statistical
