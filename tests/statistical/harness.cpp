#include "tests/statistical/harness.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <limits>
#include <mutex>
#include <stdexcept>
#include <thread>

#include "common/bundle/bundle.h"
#include "tests/epoch_run.h"
#include "tests/integrators.h"
#include "tests/paths.h"
#include "tests/statistical/moments.h"
#include "tests/statistical/quantiles.h"

namespace candela::statistical {
namespace {

[[noreturn]] void give_up(const Error& error) {
  throw std::runtime_error(error.to_string());
}

SettingsMap settings_in_scene(const description::FileSource& files, const std::string& key) {
  const auto description = description::parse_scene(files, key, {});
  if (!description.ok()) give_up(description.error());
  SettingsMap from_scene;
  for (const auto& integrator : description->scene->children_of("integrator"))
    for (const auto& property : integrator->properties) {
      if (property.type == description::PropertyType::integer)
        from_scene[property.name] = std::to_string(std::get<std::int64_t>(property.value));
      else if (property.type == description::PropertyType::boolean)
        from_scene[property.name] = std::get<bool>(property.value) ? "true" : "false";
    }
  return from_scene;
}

// The layers of a job with epochs: both halves, for they decide together.
std::vector<std::vector<double>> job_means(const render::Renderer& renderer, const PilotResult& pilot,
                                           std::uint64_t iterations, const render::RunContext& run) {
  const auto job = test::render_job(renderer, pilot, iterations, run);
  if (!job.ok()) give_up(job.error());
  for (const std::uint64_t rejected : job->tallies().rejected)
    if (rejected != 0) throw std::runtime_error(fmt::format("{} samples were rejected", rejected));
  std::vector<std::vector<double>> layers;
  for (std::size_t layer = 0; layer < job->layout.layers; ++layer) layers.push_back(job->mean(layer));
  return layers;
}

}  // namespace

Result<description::FileSource::Bytes> MemorySource::open(const std::string& key) const {
  const auto found = files_.find(key);
  if (found == files_.end()) return input_error("no such file").at(key, 0);
  return Bytes{nullptr, found->second};
}

std::string shared_folder() {
  const std::filesystem::path folder = test::shared_path();
  return std::filesystem::is_directory(folder / "scenes") ? folder.string() : std::string();
}

TestScene read_scene(TestScene scene, std::uint32_t width, std::uint32_t height) {
  scene.settings.width = width;
  scene.settings.height = height;
  scene.from_scene = settings_in_scene(*scene.files, scene.main_key);
  return with_integrator(std::move(scene), "path");
}

void use_own_filter(TestScene& scene) {
  const auto description = description::parse_scene(*scene.files, scene.main_key, {});
  if (!description.ok()) give_up(description.error());
  for (const auto& sensor : description->scene->children_of("sensor"))
    for (const auto& film : sensor->children_of("film"))
      for (const auto& filter : film->children_of("rfilter")) {
        scene.settings.filter = filter->plugin;
        for (const auto& property : filter->properties)
          scene.settings.filter_settings[property.name] = fmt::format("{}", std::get<double>(property.value));
      }
}

TestScene scene_from_xml(const std::string& xml, std::uint32_t width, std::uint32_t height) {
  TestScene scene;
  scene.files = std::make_shared<MemorySource>(std::map<std::string, std::string>{{"scene.xml", xml}});
  scene.main_key = "scene.xml";
  return read_scene(std::move(scene), width, height);
}

TestScene scene_from_shared(const std::string& name, std::uint32_t width, std::uint32_t height) {
  TestScene scene;
  scene.files = std::make_shared<bundle::DiskSource>(shared_folder() + "/scenes/" + name);
  scene.main_key = "scene.xml";
  return read_scene(std::move(scene), width, height);
}

TestScene scene_from_transport(std::string_view name, std::uint32_t width, std::uint32_t height) {
  TestScene scene;
  scene.files = std::make_shared<bundle::DiskSource>(test::source_path("tests/statistical/transport"));
  scene.main_key = fmt::format("{}.xml", name);
  return read_scene(std::move(scene), width, height);
}

std::unique_ptr<render::Renderer> make_renderer(const TestScene& scene) {
  auto renderer = render::Renderer::create(*scene.files, scene.main_key, {}, scene.settings, 2);
  if (!renderer.ok()) give_up(renderer.error());
  return std::move(renderer).value();
}

std::vector<std::vector<float>> render_batches(TestScene scene, std::uint64_t seed, std::size_t batches,
                                               std::uint64_t iterations, unsigned threads) {
  std::vector<std::vector<float>> images;
  render::RunContext run;
  run.threads = threads;
  for (std::size_t batch = 0; batch < batches; ++batch) {
    scene.settings.seed = seed + batch;
    const auto renderer = make_renderer(scene);
    const auto pilot = renderer->pilot(run);
    if (!pilot.ok()) give_up(pilot.error());
    if (test::has_epochs(scene.settings.integrator)) {
      const auto mean = job_means(*renderer, *pilot, iterations, run).at(0);
      images.emplace_back(mean.begin(), mean.end());
      continue;
    }
    auto output = renderer->make_output(pilot->state);
    const auto& film = output.film;
    const auto done = renderer->run({Unit::Kind::iterations, 0, 0, iterations}, {}, output, run);
    if (!done.ok()) give_up(done.error());
    for (std::uint64_t rejected : film->tallies().rejected)
      if (rejected != 0) throw std::runtime_error(fmt::format("{} samples were rejected", rejected));
    const double to_value = std::ldexp(1.0, -film->scale_log2()) / static_cast<double>(iterations);
    std::vector<float> image(film->layout().pixel_count() * 3);
    for (std::size_t i = 0; i < image.size(); ++i)
      image[i] = static_cast<float>(static_cast<double>(film->sums()[i]) * to_value);
    images.push_back(std::move(image));
  }
  return images;
}

bool has_integrator(const std::string& name) {
  const auto names = render::integrator_names();
  return std::find(names.begin(), names.end(), name) != names.end();
}

TestScene with_integrator(TestScene scene, const std::string& name, const SettingsMap& settings) {
  const auto known = render::integrator_settings(name);
  if (!known.ok()) give_up(known.error());
  SettingsMap from_scene;
  for (const auto& setting : *known)
    if (const auto found = scene.from_scene.find(setting.name); found != scene.from_scene.end())
      from_scene.insert(*found);
  auto complete = render::complete_integrator_settings(name, from_scene, settings);
  if (!complete.ok()) give_up(complete.error());
  scene.settings.integrator = name;
  scene.settings.integrator_settings = std::move(complete).value();
  return scene;
}

bool long_form() {
  const char* value = std::getenv("CANDELA_LONG");
  return value != nullptr && std::string(value) != "0" && *value != '\0';
}

NamedState pilot_state(const TestScene& scene) {
  const auto pilot = make_renderer(scene)->pilot({});
  if (!pilot.ok()) give_up(pilot.error());
  return pilot->state;
}

std::vector<std::vector<double>> render_layers(const TestScene& scene, const NamedState& state,
                                               std::uint64_t seed, std::uint32_t half, std::uint64_t first,
                                               std::uint64_t iterations, unsigned threads) {
  TestScene seeded = scene;
  seeded.settings.seed = seed;
  const auto renderer = make_renderer(seeded);
  render::RunContext run;
  run.threads = threads;
  if (test::has_epochs(scene.settings.integrator)) {
    if (first != 0) throw std::runtime_error("a job with epochs begins with its first iteration");
    auto pilot = renderer->pilot(run);
    if (!pilot.ok()) give_up(pilot.error());
    pilot->state = state;
    return job_means(*renderer, *pilot, iterations, run);
  }
  auto output = renderer->make_output(state);
  const auto& film = output.film;
  const auto done = renderer->run({Unit::Kind::iterations, half, first, first + iterations}, {}, output, run);
  if (!done.ok()) give_up(done.error());
  for (const std::uint64_t rejected : film->tallies().rejected)
    if (rejected != 0)
      throw std::runtime_error(fmt::format("{} samples of {} were rejected (seed {}, half {}, first {})",
                                           rejected, scene.settings.integrator, seed, half, first));
  const double to_value = std::ldexp(1.0, -film->scale_log2()) / static_cast<double>(iterations);
  const std::size_t values = film->layout().pixel_count() * 3;
  std::vector<std::vector<double>> layers(film->layout().layers, std::vector<double>(values));
  for (std::size_t layer = 0; layer < layers.size(); ++layer)
    for (std::size_t i = 0; i < values; ++i)
      layers[layer][i] = static_cast<double>(film->sums()[layer * values + i]) * to_value;
  return layers;
}

namespace {

// take(batch, weight, layer) for every batch and term, batches beside each other.
template <class Take>
void render_terms(const std::vector<Term>& terms, const BatchPlan& plan, std::uint64_t stage, double effort,
                  const Take& take) {
  const auto iterations =
      static_cast<std::uint64_t>(std::ceil(static_cast<double>(plan.iterations) * effort));
  std::vector<NamedState> states;
  for (const Term& term : terms) states.push_back(pilot_state(term.scene));
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::exception_ptr trouble;
  const auto work = [&] {
    for (std::size_t batch = next++; batch < plan.batches; batch = next++) try {
        for (std::size_t t = 0; t < terms.size(); ++t) {
          const auto layers = render_layers(terms[t].scene, states[t], plan.seed + (stage << 20) + batch,
                                            static_cast<std::uint32_t>(batch % 2), plan.first, iterations);
          take(batch, terms[t].weight, layers.at(plan.layer));
        }
      } catch (...) {
        const std::lock_guard lock(mutex);
        trouble = std::current_exception();
      }
  };
  {
    std::vector<std::jthread> threads;
    for (unsigned i = 0; i < plan.threads; ++i) threads.emplace_back(work);
  }
  if (trouble) std::rethrow_exception(trouble);
}

}  // namespace

Rows render_rows(const std::vector<Term>& terms, const BatchPlan& plan, const Regions& regions,
                 std::uint64_t stage, double effort) {
  Rows rows(plan.batches, std::vector<double>(regions.values(), 0.0));
  render_terms(terms, plan, stage, effort,
               [&](std::size_t batch, double weight, const std::vector<double>& layer) {
                 const auto means = regions.means(layer);
                 for (std::size_t i = 0; i < means.size(); ++i) rows[batch][i] += weight * means[i];
               });
  return rows;
}

std::vector<std::vector<float>> render_images(const std::vector<Term>& terms, const BatchPlan& plan) {
  const JobSettings& settings = terms.at(0).scene.settings;
  const std::size_t values = std::size_t{settings.width} * settings.height * 3;
  std::vector<std::vector<float>> images(plan.batches, std::vector<float>(values, 0.0f));
  render_terms(terms, plan, 1, 1, [&](std::size_t batch, double weight, const std::vector<double>& layer) {
    for (std::size_t i = 0; i < values; ++i) images[batch][i] += static_cast<float>(weight * layer[i]);
  });
  return images;
}

Estimator make_estimator(const std::string& name, std::vector<Term> terms, const BatchPlan& plan,
                         const Regions& regions) {
  return {name, [terms = std::move(terms), plan, regions](std::uint64_t stage, double effort) {
            return render_rows(terms, plan, regions, stage, effort);
          }};
}

BlockTestResult block_test(const std::vector<std::vector<float>>& batches,
                           const std::vector<float>& reference, const std::vector<float>& reference_stderr,
                           std::uint32_t width, std::uint32_t height, const BlockTestOptions& options) {
  constexpr double kKnown = std::numeric_limits<double>::infinity();  // freedom of a variance that is
  const std::uint32_t block = options.block;
  BlockTestResult result;
  double chi_squared = 0, weights = 0, weighted = 0, reference_squares = 0;
  std::vector<double> ratios(batches.size(), 0.0);  // of each batch, not yet divided by the weights
  std::vector<double> relative_errors;
  for (std::uint32_t by = 0; by < height; by += block) {
    for (std::uint32_t bx = 0; bx < width; bx += block) {
      const auto listed = [&](const auto& blocks) {
        return std::find(blocks.begin(), blocks.end(), std::pair(bx, by)) != blocks.end();
      };
      if (listed(options.excluded)) continue;
      const bool only_brighter = listed(options.only_brighter);
      for (std::uint32_t channel = 0; channel < 3; ++channel) {
        std::vector<double> means(batches.size(), 0.0);
        double expected = 0, expected_variance = 0, pixels = 0;
        for (std::uint32_t y = by; y < std::min(by + block, height); ++y) {
          for (std::uint32_t x = bx; x < std::min(bx + block, width); ++x) {
            const std::size_t i = (std::size_t{y} * width + x) * 3 + channel;
            for (std::size_t k = 0; k < batches.size(); ++k) means[k] += static_cast<double>(batches[k][i]);
            expected += static_cast<double>(reference[i]);
            if (!reference_stderr.empty())
              expected_variance +=
                  static_cast<double>(reference_stderr[i]) * static_cast<double>(reference_stderr[i]);
            pixels += 1;
          }
        }
        expected /= pixels;
        expected_variance /= pixels * pixels;
        Moments own;
        for (double& value : means) own.add(value /= pixels);
        const double mean = own.mean();
        double largest = 0;
        for (const double value : means) largest = std::max(largest, (value - mean) * (value - mean));
        // Rounding of floats and of the analytic answer itself, so that exact agreement is not tested for
        // exact zero variance.
        const double rounding = 1e-6 * std::max(std::fabs(expected), std::fabs(mean));
        const double own_variance = own.variance_of_mean();
        // The reference's own degrees of freedom are taken as at least 7 (its README: 8 to 30 runs).
        const EstimatedVariance sum = EstimatedVariance{own_variance, own.freedom()} +
                                      EstimatedVariance{expected_variance, 7} +
                                      EstimatedVariance{rounding * rounding, kKnown};
        const double variance = sum.variance, deviation = std::sqrt(variance);
        if (expected == 0 && mean == 0) continue;
        if (deviation > options.max_relative_error * std::fabs(expected) ||
            (largest > 0.8 * own.variance() * own.freedom() && own_variance > expected_variance &&
             own_variance > rounding * rounding)) {
          ++result.skipped;
          continue;
        }
        ++result.tested;
        const double difference = only_brighter ? std::max(0.0, mean - expected) : mean - expected;
        const double beyond =
            std::max(0.0, std::fabs(difference) - options.allowed_bias * std::fabs(expected));
        const double t = t_statistic(std::copysign(beyond, difference), deviation);
        const double p = std::max(student_two_sided(t, sum.freedom), 1e-300);
        const double score = normal_quantile(p / 2);
        chi_squared += score * score;
        relative_errors.push_back(deviation / std::fabs(expected));
        const double weight = only_brighter ? 0 : expected * expected / variance;
        weights += weight;
        weighted += weight * mean / expected;
        for (std::size_t k = 0; k < batches.size(); ++k) ratios[k] += weight * means[k] / expected;
        reference_squares += weight * weight * expected_variance / (expected * expected);
        if (p < result.smallest_p) {
          result.smallest_p = p;
          result.worst =
              fmt::format("block at ({}, {}), channel {}: {} against {}, standard error {}, t = {:.2f}", bx,
                          by, channel, mean, expected, deviation, t);
        }
      }
    }
  }
  if (result.tested > 0) {
    result.adjusted_p = std::min(1.0, result.smallest_p * static_cast<double>(result.tested));
    result.chi_squared_p = chi_squared_tail(chi_squared, static_cast<double>(result.tested));
    std::nth_element(relative_errors.begin(), relative_errors.begin() + relative_errors.size() / 2,
                     relative_errors.end());
    result.median_relative_standard_error = relative_errors[relative_errors.size() / 2];
    result.ratio = weighted / weights;
    Moments spread;
    for (const double ratio : ratios) spread.add(ratio / weights);
    result.ratio_stderr = std::sqrt(spread.variance_of_mean() + 3 * reference_squares / (weights * weights));
  }
  return result;
}

}  // namespace candela::statistical
