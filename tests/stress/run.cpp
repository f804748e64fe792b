#include "tests/stress/run.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <ctime>
#include <exception>
#include <mutex>
#include <stdexcept>
#include <thread>

#include "tests/epoch_run.h"
#include "tests/integrators.h"
#include "tests/proofs/proofs.h"
#include "tests/statistical/chain_driver.h"
#include "tests/statistical/harness.h"

namespace candela::stress {
namespace {

using statistical::TestScene;

double cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

// Relative standard error above which an image that is too dark is noise.
constexpr double kNoisy = 0.03;
// And below which batches are the same.
constexpr double kEqual = 1e-6;

TestScene make_scene(const Shot& shot, const Claim& claim) {
  TestScene scene;
  auto files = shot.files;
  files["scene.xml"] = "<scene version=\"3.0.0\"><integrator type=\"path\"/>" + shot.body + "</scene>";
  scene.files = std::make_shared<statistical::MemorySource>(std::move(files));
  scene.main_key = "scene.xml";
  scene = statistical::read_scene(std::move(scene), shot.width, shot.height);
  for (const auto& [key, value] : shot.settings) scene.from_scene[key] = value;
  return statistical::with_integrator(std::move(scene), claim.integrator, claim.settings);
}

double mean_over(const Quantity& q, std::uint32_t width, const std::vector<double>& image) {
  double sum = 0;
  for (std::uint32_t y = q.y; y < q.y + q.height; ++y)
    for (std::size_t i = (std::size_t{y} * width + q.x) * 3; i < (std::size_t{y} * width + q.x + q.width) * 3;
         ++i)
      sum += image[i];
  return sum / (3.0 * q.width * q.height);
}

// One batch: its image and what was counted. Unlike the harness of the statistical tests this does not mind
// rejected samples.
std::vector<double> render_batch(const TestScene& scene, const NamedState& state, std::uint64_t seed,
                                 std::uint32_t half, std::uint64_t first, std::uint64_t iterations,
                                 const RunOptions& options, film::SampleCounts& sample_counts) {
  if (test::has_chains(scene.settings.integrator)) {
    const auto image = statistical::render_chains({scene, iterations, 1, 1}, seed);
    sample_counts = image.sample_counts;
    return image.image;
  }
  TestScene seeded = scene;
  seeded.settings.seed = seed;
  const auto renderer = statistical::make_renderer(seeded);
  render::RunContext run;
  run.fault = options.fault;
  if (test::has_epochs(scene.settings.integrator)) {  // a whole job: both halves decide together
    if (first != 0) throw std::runtime_error("a job with epochs begins with its first iteration");
    auto pilot = renderer->pilot(run);
    if (!pilot.ok()) throw std::runtime_error(pilot.error().to_string());
    pilot->state = state;
    const auto job = test::render_job(*renderer, *pilot, iterations, run);
    if (!job.ok()) throw std::runtime_error(job.error().to_string());
    sample_counts = job->sample_counts();
    for (const auto& sums : job->halves) proofs::film(statistical::identity(scene), sums.sums);
    return job->mean(0);
  }
  auto output = renderer->make_output(state);
  const auto& film = output.film;
  const auto done = renderer->run({Unit::Kind::iterations, half, first, first + iterations}, {}, output, run);
  if (!done.ok()) throw std::runtime_error(done.error().to_string());
  sample_counts = film->sample_counts();
  proofs::film(statistical::identity(scene), {film->sums(), film->layout().pixel_count() * 3});
  const double to_value = std::ldexp(1.0, -film->scale_log2()) / static_cast<double>(iterations);
  std::vector<double> image(film->layout().pixel_count() * 3);
  for (std::size_t i = 0; i < image.size(); ++i) image[i] = static_cast<double>(film->sums()[i]) * to_value;
  return image;
}

}  // namespace

std::uint64_t Point::rejected() const {
  std::uint64_t sum = 0;
  for (const std::uint64_t n : sample_counts.rejected) sum += n;
  return sum;
}

const Claim* find_claim(const Sweep& sweep, const std::string& integrator) {
  for (const Claim& claim : sweep.claims)
    if (claim.integrator == integrator) return &claim;
  return nullptr;
}

Shot complete_shot(const Sweep& sweep, double value) {
  Shot shot = sweep.shot(value);
  if (shot.quantities.empty()) shot.quantities = uniform_quantities(shot.width, shot.height, std::nullopt);
  return shot;
}

Runner::Stage Runner::render(double value, int stage, std::uint64_t iterations) const {
  const Shot shot = complete_shot(sweep_, value);
  const TestScene scene = make_scene(shot, claim_);
  const NamedState state =
      test::has_chains(claim_.integrator) ? NamedState{} : statistical::pilot_state(scene);
  Stage result;
  const std::size_t batches = proofs::probing() ? 1 : options_.batches;
  result.rows.resize(batches);
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::exception_ptr trouble;
  const auto work = [&] {
    for (std::size_t batch = next++; batch < batches; batch = next++) try {
        film::SampleCounts sample_counts;
        const auto image = render_batch(
            scene, state, options_.seed + (static_cast<std::uint64_t>(stage) << 20) + batch,
            static_cast<std::uint32_t>(batch % 2), shot.first, iterations, options_, sample_counts);
        for (const Quantity& q : shot.quantities)
          result.rows[batch].push_back(mean_over(q, shot.width, image));
        const std::lock_guard lock(mutex);
        result.sample_counts.add(sample_counts);
      } catch (...) {
        const std::lock_guard lock(mutex);
        trouble = std::current_exception();
      }
  };
  {
    std::vector<std::jthread> threads;
    for (unsigned i = 0; i < options_.threads; ++i) threads.emplace_back(work);
  }
  if (trouble) std::rethrow_exception(trouble);
  return result;
}

void Runner::note(const Shot& shot) const {
  std::string text = fmt::format("{} {} {} {}", sweep_.name, sweep_.tolerance, sweep_.floor, options_.stages);
  for (const Quantity& q : shot.quantities)
    text += fmt::format("; {} {},{} {}x{} {} {}", q.name, q.x, q.y, q.width, q.height, q.share,
                        q.expected ? fmt::format("{}", *q.expected) : "as at the benign end");
  proofs::fact("sweep", text);
}

Point Runner::run(double value) {
  Point point;
  point.sweep = sweep_.name;
  point.integrator = claim_.integrator;
  point.value = value;
  const double begin = cpu_seconds();
  try {
    const Shot shot = complete_shot(sweep_, value);
    const double alpha = kFalseAlarm / (static_cast<double>(shot.quantities.size()) * options_.stages);
    const bool paired = std::any_of(shot.quantities.begin(), shot.quantities.end(),
                                    [](const Quantity& q) { return !q.expected; });
    std::uint64_t iterations = claim_.iterations != 0 ? claim_.iterations : sweep_.iterations;
    for (int stage = 0; stage < options_.stages; ++stage, iterations *= 4) {
      const Stage here = render(value, stage, iterations);
      if (paired && !baseline_.contains(stage)) baseline_[stage] = render(sweep_.benign, stage, iterations);
      point.sample_counts.add(here.sample_counts);
      point.iterations = iterations;
      point.verdict = Verdict::within;
      if (proofs::probing()) {
        note(shot);
        proofs::fact("rejected", fmt::format("{}", fmt::join(here.sample_counts.rejected, " ")));
        break;
      }
      double worst = -1;
      for (std::size_t i = 0; i < shot.quantities.size(); ++i) {
        std::vector<double> deviations;
        double expected = 0;
        for (std::size_t batch = 0; batch < here.rows.size(); ++batch) {
          const double should = shot.quantities[i].expected.value_or(0) +
                                (shot.quantities[i].expected ? 0 : baseline_[stage].rows[batch][i]);
          expected += should / static_cast<double>(here.rows.size());
          deviations.push_back(here.rows[batch][i] - should);
        }
        const double tolerance =
            (sweep_.tolerance * std::fabs(expected) + sweep_.floor) * shot.quantities[i].share;
        Judgement judgement = judge(deviations, tolerance, alpha);
        // Too dark, but so noisy that what is missing may be rare and bright, or the same in all batches:
        // light that no sample has found yet has no variance either, and that says nothing.
        const double found = expected + judgement.mean;
        if (judgement.verdict == Verdict::broken && judgement.mean < 0 &&
            (judgement.stderr_of_mean >= kNoisy * found || judgement.stderr_of_mean <= kEqual * found))
          judgement.verdict = Verdict::undecided;
        if (judgement.verdict > point.verdict) worst = -1;
        // Nearness to the tolerance; of a tolerance of zero, any deviation at all.
        const double distance = std::fabs(judgement.mean) + judgement.stderr_of_mean;
        const double nearness = tolerance > 0 ? distance / tolerance : distance > 0 ? 1e300 : 0;
        if (judgement.verdict >= point.verdict && !(nearness <= worst)) {
          worst = nearness;
          point.verdict = judgement.verdict;
          point.quantity = shot.quantities[i].name;
          point.measured = expected + judgement.mean;
          point.expected = expected;
          point.deviation = judgement.mean;
          point.stderr_of_deviation = judgement.stderr_of_mean;
          point.tolerance = tolerance;
        }
      }
      if (point.verdict != Verdict::undecided) break;
      if (static_cast<double>(here.sample_counts.rays) * 4 > options_.most_rays) break;
    }
  } catch (const std::exception& error) {
    point.verdict = Verdict::broken;
    point.refusal = error.what();
  }
  point.seconds = cpu_seconds() - begin;
  return point;
}

}  // namespace candela::stress
