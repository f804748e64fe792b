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

#include "common/bundle/gather.h"
#include "tests/epoch_run.h"
#include "tests/integrators.h"
#include "tests/paths.h"
#include "tests/proofs/proofs.h"

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
std::vector<std::vector<double>> job_means(const TestScene& scene, const render::Renderer& renderer,
                                           const PilotResult& pilot, std::uint64_t iterations,
                                           const render::RunContext& run) {
  const auto job = test::render_job(renderer, pilot, iterations, run);
  if (!job.ok()) give_up(job.error());
  for (const auto& half : job->halves) proofs::film(identity(scene), half.sums);
  for (const std::uint64_t rejected : job->sample_counts().rejected)
    if (rejected != 0) throw std::runtime_error(fmt::format("{} samples were rejected", rejected));
  std::vector<std::vector<double>> layers;
  for (std::size_t layer = 0; layer < job->layout.layers; ++layer) layers.push_back(job->mean(layer));
  return layers;
}

// In the probe of a test the same scene is rendered once, whatever its seeds.
class Once {
 public:
  template <class Value, class Make>
  static Value get(const std::string& what, const Make& make) {
    static std::mutex mutex;
    static std::map<std::string, Value> values;
    const std::lock_guard lock(mutex);
    const std::string key = proofs::in_this_test(what);
    const auto found = values.find(key);
    return found != values.end() ? found->second : values.emplace(key, make()).first->second;
  }
};

// In the probe: a batch's image, and as many copies as were asked for, of different brightness.
std::vector<std::vector<float>> copies(const std::vector<float>& image, std::size_t batches) {
  std::vector<std::vector<float>> images(batches, image);
  for (std::size_t batch = 0; batch < batches; ++batch)
    for (float& value : images[batch]) value *= 1 + 1e-3f * static_cast<float>(batch % 5);
  return images;
}

// Iterations [0, n) of half 0 in one film; in the probe of n of each of `batches`, those at both ends.
std::vector<Unit> units_of_batch(std::uint64_t iterations, std::size_t batches) {
  if (!proofs::probing()) return {{Unit::Kind::iterations, 0, 0, iterations}};
  const proofs::Ends ends = proofs::probe_ends(iterations, batches);
  std::vector<Unit> units = {{Unit::Kind::iterations, 0, 0, ends.first}};
  if (ends.last > 0) units.push_back({Unit::Kind::iterations, 0, iterations - ends.last, iterations});
  return units;
}

}  // namespace

std::string identity(const TestScene& scene) {
  const JobSettings& s = scene.settings;
  std::string text = fmt::format("{} {}x{} {}\n{} {} {}\n", s.integrator, s.width, s.height, scene.main_key,
                                 s.filter, s.sampler, s.aovs);
  // Settings at their defaults are left out: a new one then is no new job. A default that changes is seen in
  // the films.
  const auto known = render::integrator_settings(s.integrator);
  if (!known.ok()) give_up(known.error());
  for (const auto& [name, value] : s.integrator_settings) {
    const auto found = std::find_if(known->begin(), known->end(),
                                    [&](const render::SettingDoc& one) { return one.name == name; });
    if (found == known->end() || found->default_value != value) text += fmt::format("{}={}\n", name, value);
  }
  for (const auto& [name, value] : s.filter_settings) text += fmt::format("{}={}\n", name, value);
  const auto bytes = scene.files->open(scene.main_key);
  if (!bytes.ok()) give_up(bytes.error());
  return text + std::string(bytes->view);
}

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

namespace {

// A renderer whose units have what its own pilot decides, whatever state they are given.
class DecidedRenderer final : public render::Renderer {
 public:
  explicit DecidedRenderer(std::unique_ptr<render::Renderer> real) : real_(std::move(real)) {}
  Result<PilotResult> pilot(const render::RunContext& context) const override {
    return real_->pilot(context);
  }
  render::UnitOutput make_output(const NamedState& state) const override { return real_->make_output(state); }
  Result<void> run(const Unit& unit, const render::UnitInput& input, render::UnitOutput& output,
                   const render::RunContext& context) const override {
    std::call_once(once_, [&] {
      render::RunContext own;
      own.threads = context.threads;
      decided_ = real_->pilot(own);
    });
    if (!decided_->ok()) return decided_->error();
    render::UnitInput with = input;
    with.state.decided = decided_->value().state.decided;
    return real_->run(unit, with, output, context);
  }
  Result<std::string> plan_text() const override { return real_->plan_text(); }
  const scene::SceneFeatures* features() const override { return real_->features(); }

 private:
  const std::unique_ptr<render::Renderer> real_;
  mutable std::once_flag once_;
  mutable std::optional<Result<PilotResult>> decided_;
};

}  // namespace

std::unique_ptr<render::Renderer> make_renderer(const TestScene& scene) {
  auto renderer = render::Renderer::create(*scene.files, scene.main_key, {}, scene.settings, 2);
  if (!renderer.ok()) give_up(renderer.error());
  const auto& row = test::integrator_row(scene.settings.integrator);
  // The others decide nothing.
  if (!row.merges && row.name != "optimis" && row.name != "erpt") return std::move(renderer).value();
  return std::make_unique<DecidedRenderer>(std::move(renderer).value());
}

namespace {

std::vector<float> render_batch(const TestScene& scene, const std::vector<Unit>& units,
                                std::uint64_t iterations, unsigned threads) {
  render::RunContext run;
  run.threads = threads;
  const auto renderer = make_renderer(scene);
  const auto pilot = renderer->pilot(run);
  if (!pilot.ok()) give_up(pilot.error());
  if (test::has_epochs(scene.settings.integrator)) {
    const auto mean = job_means(scene, *renderer, *pilot, iterations, run).at(0);
    return {mean.begin(), mean.end()};
  }
  auto output = renderer->make_output(pilot->state);
  const auto& film = output.film;
  std::uint64_t rendered = 0;
  for (const Unit& unit : units) {
    const auto done = renderer->run(unit, {pilot->state, {}, {}}, output, run);
    if (!done.ok()) give_up(done.error());
    rendered += unit.end - unit.begin;
  }
  for (std::uint64_t rejected : film->sample_counts().rejected)
    if (rejected != 0) throw std::runtime_error(fmt::format("{} samples were rejected", rejected));
  const double to_value = std::ldexp(1.0, -film->scale_log2()) / static_cast<double>(rendered);
  proofs::film(identity(scene), {film->sums(), film->layout().pixel_count() * 3 * film->layout().layers});
  std::vector<float> image(film->layout().pixel_count() * 3);
  for (std::size_t i = 0; i < image.size(); ++i)
    image[i] = static_cast<float>(static_cast<double>(film->sums()[i]) * to_value);
  return image;
}

}  // namespace

std::vector<std::vector<float>> render_batches(TestScene scene, std::uint64_t seed, std::size_t batches,
                                               std::uint64_t iterations, unsigned threads) {
  if (proofs::probing() && batches > 1) {
    const auto image =
        Once::get<std::vector<float>>(fmt::format("{} {} {}", iterations, batches, identity(scene)), [&] {
          TestScene first = scene;
          first.settings.seed = seed;
          return render_batch(first, units_of_batch(iterations, batches), iterations, threads);
        });
    return copies(image, batches);
  }
  std::vector<std::vector<float>> images;
  for (std::size_t batch = 0; batch < batches; ++batch) {
    scene.settings.seed = seed + batch;
    images.push_back(render_batch(scene, units_of_batch(iterations, batches), iterations, threads));
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
  const bool has_radius = std::any_of(known->begin(), known->end(), [](const render::SettingDoc& setting) {
    return setting.name == "radius";
  });
  if (has_radius) from_scene.insert({"radius", kRadiusOfTests});
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

namespace {

std::vector<std::vector<double>> render_layers_now(const TestScene& scene, const NamedState& state,
                                                   std::uint64_t seed, std::uint32_t half,
                                                   std::uint64_t first, std::uint64_t iterations,
                                                   unsigned threads) {
  TestScene seeded = scene;
  seeded.settings.seed = seed;
  const auto renderer = make_renderer(seeded);
  render::RunContext run;
  run.threads = threads;
  auto pilot = renderer->pilot(run);
  if (!pilot.ok()) give_up(pilot.error());
  pilot->state.film_scale_log2 = state.film_scale_log2;
  if (test::has_epochs(scene.settings.integrator)) {
    if (first != 0) throw std::runtime_error("a job with epochs begins with its first iteration");
    return job_means(scene, *renderer, *pilot, iterations, run);
  }
  auto output = renderer->make_output(pilot->state);
  const auto& film = output.film;
  const auto done = renderer->run({Unit::Kind::iterations, half, first, first + iterations},
                                  {pilot->state, {}, {}}, output, run);
  if (!done.ok()) give_up(done.error());
  for (const std::uint64_t rejected : film->sample_counts().rejected)
    if (rejected != 0)
      throw std::runtime_error(fmt::format("{} samples of {} were rejected (seed {}, half {}, first {})",
                                           rejected, scene.settings.integrator, seed, half, first));
  const double to_value = std::ldexp(1.0, -film->scale_log2()) / static_cast<double>(iterations);
  const std::size_t values = film->layout().pixel_count() * 3;
  proofs::film(identity(scene), {film->sums(), values * film->layout().layers});
  std::vector<std::vector<double>> layers(film->layout().layers, std::vector<double>(values));
  for (std::size_t layer = 0; layer < layers.size(); ++layer)
    for (std::size_t i = 0; i < values; ++i)
      layers[layer][i] = static_cast<double>(film->sums()[layer * values + i]) * to_value;
  return layers;
}

}  // namespace

std::vector<std::vector<double>> render_layers(const TestScene& scene, const NamedState& state,
                                               std::uint64_t seed, std::uint32_t half, std::uint64_t first,
                                               std::uint64_t iterations, unsigned threads) {
  // Only iterations that a term of a plan asks for may be fewer in the probe: here the caller divides by
  // them.
  if (!proofs::probing()) return render_layers_now(scene, state, seed, half, first, iterations, threads);
  return Once::get<std::vector<std::vector<double>>>(
      fmt::format("{} {} {} {}", first, iterations, state.film_scale_log2, identity(scene)),
      [&] { return render_layers_now(scene, state, seed, half, first, iterations, threads); });
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
  // The probe renders one batch, and gives it to all in different brightness.
  const bool probing = proofs::probing();
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::exception_ptr trouble;
  const auto work = [&] {
    for (std::size_t batch = next++; batch < plan.batches; batch = next++) try {
        for (std::size_t t = 0; t < terms.size(); ++t) {
          const auto layers = render_layers(terms[t].scene, states[t], plan.seed + (stage << 20) + batch,
                                            static_cast<std::uint32_t>(batch % 2), plan.first, iterations);
          const double brightness = probing ? 1 + 1e-3 * static_cast<double>(batch % 5) : 1;
          take(batch, terms[t].weight * brightness, layers.at(plan.layer));
        }
      } catch (...) {
        const std::lock_guard lock(mutex);
        trouble = std::current_exception();
      }
  };
  {
    std::vector<std::jthread> threads;
    for (unsigned i = 0; i < (probing ? 1 : plan.threads); ++i) threads.emplace_back(work);
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

}  // namespace candela::statistical
