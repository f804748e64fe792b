#include "tests/golden/film_hash.h"

#include <bit>
#include <charconv>
#include <filesystem>
#include <memory>
#include <stdexcept>

#include "common/base/hash.h"
#include "common/bundle/gather.h"
#include "tests/epoch_run.h"
#include "tests/integrators.h"
#include "tests/paths.h"
#include "tests/statistical/chain_driver.h"
#include "tests/statistical/harness.h"

namespace candela::golden {
namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t kWidth = 48, kHeight = 32;

// Settings of a film's render, beside its scene and its integrator's settings.
struct RenderPlan {
  std::uint64_t iterations = 4;
  std::uint64_t rounds = 2;
  unsigned threads = 1;
};

// Causes added later enter the digest only if their count is not 0, so that digests of earlier films stay.
constexpr auto kFirstCauses = static_cast<std::size_t>(film::RejectCause::statistics);

class FilmDigest {
 public:
  void number(std::uint64_t value) {
    for (int byte = 0; byte < 8; ++byte) bytes_ += static_cast<char>((value >> (8 * byte)) & 0xff);
  }
  void number(double value) { number(std::bit_cast<std::uint64_t>(value)); }
  void text(const std::string& value) {
    number(std::uint64_t{value.size()});
    bytes_ += value;
  }
  void sums(const std::int64_t* begin, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) number(static_cast<std::uint64_t>(begin[i]));
  }
  void sample_counts(const film::SampleCounts& sample_counts) {
    number(sample_counts.eye_samples);
    number(sample_counts.light_paths);
    for (std::size_t cause = 0; cause < sample_counts.rejected.size(); ++cause)
      if (cause < kFirstCauses || sample_counts.rejected[cause] != 0) number(sample_counts.rejected[cause]);
  }
  void normalisation(const chains::Normalisation& normalisation) {
    number(normalisation.b);
    number(normalisation.standard_error);
    number(normalisation.samples);
  }
  void record(const chains::ChainRecord& record) {
    const chains::ChainCounts& counts = record.counts;
    number(record.segments);
    for (const std::uint64_t count : {counts.mutations, counts.accepted, counts.large_steps,
                                      counts.large_accepted, counts.longest_stay, counts.present_stay})
      number(count);
    number(counts.large_sum);
    number(counts.large_square_sum);
    if (const auto& m = counts.mollified) {
      for (const double value :
           {m->start_share, m->large_sum, m->large_square_sum, m->large_product_sum, m->stay_sum})
        number(value);
      number(m->lost);
    }
    number(static_cast<double>(counts.stay_x));
    number(static_cast<double>(counts.stay_y));
  }
  std::string hex() const { return sha256_hex(bytes_); }

 private:
  std::string bytes_;
};

// The folder of the scene's file.
fs::path folder_of(const std::string& scene) {
  const fs::path tests = test::source_path("tests");
  for (const char* folder : {"golden/scenes", "statistical/transport", "statistical/gallery"})
    if (fs::exists(tests / folder / (scene + ".xml"))) return tests / folder;
  throw std::runtime_error("no scene '" + scene +
                           "' in tests/golden/scenes, tests/statistical/transport or gallery");
}

std::uint64_t count_of(const std::string& name, const std::string& text) {
  std::uint64_t value = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (code != std::errc() || end != text.data() + text.size() || value == 0)
    throw std::runtime_error(name + "=" + text + ": not a whole number above 0");
  return value;
}

statistical::TestScene scene_of(const GoldenFilm& film, RenderPlan& plan) {
  statistical::TestScene scene;
  scene.files = std::make_shared<bundle::DiskSource>(folder_of(film.scene));
  scene.main_key = film.scene + ".xml";
  scene = statistical::read_scene(std::move(scene), kWidth, kHeight);
  statistical::use_own_filter(scene);
  scene.settings.seed = 1;
  if (test::has_epochs(film.integrator)) plan.iterations = 12;
  const auto& small = test::integrator_row(film.integrator).small;
  SettingsMap of_integrator(small.begin(), small.end());
  for (const auto& [name, value] : film.settings) {
    if (name == "filter") {
      scene.settings.filter = value;
      scene.settings.filter_settings.clear();
    } else if (name == "sampler") {
      scene.settings.sampler = value;
    } else if (name == "isa") {
      scene.settings.isa = value;
    } else if (name == "seed") {
      scene.settings.seed = count_of(name, value);
    } else if (name == "iterations") {
      plan.iterations = count_of(name, value);
    } else if (name == "rounds") {
      plan.rounds = count_of(name, value);
    } else if (name == "threads") {
      plan.threads = static_cast<unsigned>(count_of(name, value));
    } else {
      of_integrator[name] = value;
    }
  }
  if (plan.iterations % 2 != 0) throw std::runtime_error("iterations is not an even number");
  return statistical::with_integrator(std::move(scene), film.integrator, of_integrator);
}

std::string hash_of_iterations(const statistical::TestScene& scene, const RenderPlan& plan) {
  FilmDigest digest;
  const auto renderer = statistical::make_renderer(scene);
  render::RunContext run;
  run.threads = plan.threads;
  const auto pilot = renderer->pilot(run);
  if (!pilot.ok()) throw std::runtime_error(pilot.error().to_string());
  for (const std::string& layer : pilot->work.layers) digest.text(layer);
  const auto job = test::render_job(*renderer, *pilot, plan.iterations, run);
  if (!job.ok()) throw std::runtime_error(job.error().to_string());
  for (const test::JobSums::Half& half : job->halves) {
    for (const std::uint32_t extent : {job->layout.width, job->layout.height, job->layout.layers})
      digest.number(std::uint64_t{extent});
    digest.number(static_cast<std::uint64_t>(job->scale_log2));
    digest.sums(half.sums.data(), half.sums.size());
    digest.sample_counts(half.sample_counts);
  }
  for (const std::string& state : job->states) digest.text(state);
  return digest.hex();
}

std::string hash_of_chains(const statistical::TestScene& scene, const RenderPlan& plan) {
  const statistical::ChainImage image =
      statistical::render_chains({scene, plan.rounds, plan.threads}, scene.settings.seed);
  FilmDigest digest;
  for (const std::uint64_t count :
       {std::uint64_t{image.width}, std::uint64_t{image.height}, std::uint64_t{image.plan.chains},
        image.plan.bootstrap_samples, image.plan.segment_mutations})
    digest.number(count);
  digest.number(static_cast<std::uint64_t>(image.state.film_scale_log2));
  digest.normalisation(image.b0);
  digest.normalisation(image.b);
  digest.sums(image.sums.data(), image.sums.size());
  digest.sample_counts(image.sample_counts);
  for (const chains::ChainRecord& record : image.records) digest.record(record);
  return digest.hex();
}

}  // namespace

std::string film_hash(const GoldenFilm& film) {
  RenderPlan plan;
  const statistical::TestScene scene = scene_of(film, plan);
  return test::has_chains(film.integrator) ? hash_of_chains(scene, plan) : hash_of_iterations(scene, plan);
}

}  // namespace candela::golden
