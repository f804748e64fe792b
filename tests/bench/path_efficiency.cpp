// Samples per CPU second and relMSE times CPU seconds of `path` on one thread, against a reference image: the
// figures of docs/benchmarks.md beside those of other renderers. Loading is not counted.
//
//   bench_path_efficiency SCENE.xml REFERENCE.exr [--iterations N] [--seeds K] [--sampler NAME] [--set
//   key=value ...]
#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "common/bundle/gather.h"
#include "common/image/image.h"
#include "common/stats/image_error.h"
#include "tests/bench/count_argument.h"
#include "worker/render/renderer.h"

namespace {

using namespace candela;

double cpu_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec) + 1e-6 * static_cast<double>(usage.ru_utime.tv_usec);
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

int fail(const std::string& message) {
  std::fprintf(stderr, "bench_path_efficiency: %s\n", message.c_str());
  return 2;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3)
    return fail("usage: SCENE.xml REFERENCE.exr [--iterations N] [--seeds K] [--sampler S] [--set k=v]");
  const std::filesystem::path scene_path = argv[1];
  std::uint64_t iterations = 64, seeds = 5;
  JobSettings settings;
  SettingsMap chosen;
  for (int i = 3; i + 1 < argc; i += 2) {
    const std::string option = argv[i], value = argv[i + 1];
    if (option == "--iterations") {
      iterations = bench::count_argument(option, argv[i + 1], 1, 1e9);
    } else if (option == "--seeds") {
      seeds = bench::count_argument(option, argv[i + 1], 1, 1e6);
    } else if (option == "--sampler") {
      settings.sampler = value;
    } else if (option == "--set" && value.find('=') != std::string::npos) {
      chosen[value.substr(0, value.find('='))] = value.substr(value.find('=') + 1);
    } else {
      return fail("unknown option " + option);
    }
  }
  const auto reference = image::read_image(argv[2]);
  if (!reference.ok()) return fail(reference.error().to_string());
  settings.width = reference->width;
  settings.height = reference->height;
  const auto gathered = bundle::gather(scene_path, {});
  if (!gathered.ok()) return fail(gathered.error().to_string());
  SettingsMap from_scene;
  for (const auto& integrator : gathered->description.scene->children_of("integrator"))
    for (const auto& p : integrator->properties)
      if (p.type == description::PropertyType::integer)
        from_scene[p.name] = std::to_string(std::get<std::int64_t>(p.value));
  auto complete = render::complete_integrator_settings("path", from_scene, chosen);
  if (!complete.ok()) return fail(complete.error().to_string());
  settings.integrator_settings = *complete;
  const bundle::DiskSource files(scene_path.parent_path());

  std::vector<double> rates, ray_rates, efficiencies, trimmed;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    settings.seed = seed;
    const auto renderer = render::Renderer::create(files, scene_path.filename(), {}, settings, 1);
    if (!renderer.ok()) return fail(renderer.error().to_string());
    const render::RunContext run;
    const auto pilot = (*renderer)->pilot(run);
    if (!pilot.ok()) return fail(pilot.error().to_string());
    auto output = (*renderer)->make_output(pilot->state);
    const auto& film = output.film;
    const double begin = cpu_seconds();
    const auto done =
        (*renderer)->run({Unit::Kind::iterations, 0, 0, iterations}, {pilot->state, {}, {}}, output, run);
    const double seconds = cpu_seconds() - begin;
    if (!done.ok()) return fail(done.error().to_string());
    const double to_value = std::ldexp(1.0, -film->scale_log2()) / static_cast<double>(iterations);
    std::vector<float> image(reference->rgb.size());
    for (std::size_t i = 0; i < image.size(); ++i)
      image[i] = static_cast<float>(static_cast<double>(film->sums()[i]) * to_value);
    const auto error = stats::compare(image, reference->rgb, settings.width, settings.height);
    rates.push_back(static_cast<double>(film->sample_counts().eye_samples) / seconds);
    ray_rates.push_back(static_cast<double>(film->sample_counts().rays) / seconds);
    efficiencies.push_back(error.relmse * seconds);
    trimmed.push_back(error.relmse_trimmed * seconds);
    std::printf(
        "seed %2llu: %.2f s, %.3f M samples/s, %.2f M rays/s, relMSE %.4e (trimmed %.4e), mean ratio %.4f\n",
        static_cast<unsigned long long>(seed), seconds, rates.back() * 1e-6, ray_rates.back() * 1e-6,
        error.relmse, error.relmse_trimmed, error.mean_ratio);
  }
  std::printf(
      "median: %.3f M samples per CPU second, %.2f M rays per CPU second, relMSE x CPU s %.4f (trimmed "
      "%.4f)\n",
      median(rates) * 1e-6, median(ray_rates) * 1e-6, median(efficiencies), median(trimmed));
  return 0;
}
