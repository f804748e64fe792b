// Light that bidirectional path tracing cannot sample, by mollified connections in path tracing,
// bidirectional path tracing and chains, and by merging, in equal CPU time: error, noise and bias.
//
// A method's number of units is that of the CPU seconds of the study, by the rate of its first ones; the same
// for all seeds. Errors are squared, each value's over its own square plus 1 % of the picture's squared mean,
// against two references (image_errors.h). noise: the part of the error that differs from seed to seed; bias:
// what the mean over seeds keeps.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "common/base/version.h"
#include "tests/bench/candela_bench/estimator.h"
#include "tests/bench/candela_study/image_errors.h"
#include "tests/bench/candela_study/kept.h"
#include "tests/bench/candela_study/renders.h"
#include "tests/bench/candela_study/study.h"
#include "tests/paths.h"
#include "worker/render/renderer.h"

namespace candela::study {
namespace {

struct HiddenLight {
  const char* name;
  const char* file;
  std::uint64_t reference_count;  // iterations of vcm
};
constexpr HiddenLight kHiddenLights[] = {
    {"bulb", "tests/bench/candela_study/scenes/bulb-mirror.xml", 1200},
    {"mirror-caustic", "tests/bench/candela_study/scenes/mirror-caustic.xml", 1200},
    {"pane", "tests/statistical/transport/point-sds.xml", 1200},
};
// Its blur ends below a pixel. A smaller first radius finds too few photons: errors against such references
// are of what they lack.
constexpr const char* kHiddenReferenceRadius = "0.012";

const std::vector<Method>& hidden_methods() {
  static const SettingsMap on = {{"regularise", "on"}};
  static const SettingsMap chains_on = {{"regularise", "on"}, {"bootstrap", "20000"}};
  static const std::vector<Method> all = {
      {"path", "path", {}},
      {"path, regularise", "path", on},
      {"bdpt", "bdpt", {}},
      {"bdpt, regularise", "bdpt", on},
      {"bdpt, regularise, radius 5 %", "bdpt", {{"regularise", "on"}, {"regularise_radius", "0.05"}}},
      {"pssmlt, regularise", "pssmlt", chains_on},
      {"mmlt, regularise", "mmlt", chains_on},
      {"mlt, regularise", "mlt", {{"regularise", "on"}, {"bootstrap", "20000"}, {"direct", "chain"}}},
      {"ppm", "ppm", {}},
      {"vcm", "vcm", {}},
      {"mcppm", "mcppm", {}},
  };
  return all;
}

struct HiddenSizes {
  std::uint32_t side;
  double seconds_a_pixel;         // of a method
  std::uint64_t reference_share;  // of the references' iterations: 1 / this
  double seconds() const { return seconds_a_pixel * side * side; }
};
HiddenSizes hidden_sizes(const Request& request) {
  HiddenSizes sizes = request.short_form ? HiddenSizes{12, 0.00035, 128} : HiddenSizes{24, 0.0052, 1};
  if (request.side != 0) sizes.side = request.side;
  return sizes;
}

// A run is looked at after about 1/8, 1/4, 1/2 of its rounds, and at its end.
constexpr std::uint64_t kHiddenLevels = 4;
constexpr std::uint64_t rounds_at(std::uint64_t rounds, std::uint64_t level) {
  return rounds >> (kHiddenLevels - 1 - level);
}

class HiddenTable {
 public:
  HiddenTable(const Request& request, const HiddenLight& scene)
      : request_(request), sizes_(hidden_sizes(request)), scene_(scene) {}

  Result<Results> run() {
    CANDELA_ASSIGN(const Truth truth, references());
    for (const Method& method : hidden_methods()) CANDELA_TRY(measure(method, truth));
    return std::move(results_);
  }

 private:
  Result<Truth> references() const {
    const std::uint64_t count = std::max<std::uint64_t>(16, scene_.reference_count / sizes_.reference_share);
    std::vector<Image> images;
    for (const std::uint64_t seed : {900001, 900002}) {
      const auto make = [&]() -> Result<Image> {
        const Render one{.scene = scene_.file,
                         .width = sizes_.side,
                         .height = sizes_.side,
                         .integrator = "vcm",
                         .settings = {{"radius", kHiddenReferenceRadius}, {"light_paths", "4"}},
                         .seed = seed,
                         .threads = request_.threads};
        CANDELA_ASSIGN(auto made, render_images(one, {count}));
        return std::move(made[0]);
      };
      CANDELA_ASSIGN(
          Image image,
          kept_image(request_.folder, fmt::format("{}-{}-{}-{}", scene_.name, sizes_.side, count, seed),
                     std::size_t{sizes_.side} * sizes_.side * 3, make));
      images.push_back(std::move(image));
    }
    return Truth(std::move(images[0]), std::move(images[1]));
  }

  Result<std::unique_ptr<bench::Estimator>> start(const Method& method, std::uint64_t seed) const {
    const std::filesystem::path file = test::source_path(scene_.file);
    CANDELA_ASSIGN(bench::RunSpec run, bench::make_run(file, scene_.name, method.integrator, method.settings,
                                                       sizes_.side, sizes_.side));
    run.job.seed = seed;
    run.job.sampler = "independent";
    run.threads = request_.threads;
    return bench::make_render_estimator(run);
  }
  // A whole round of units: two iterations, or a segment of each chain.
  Result<std::uint64_t> units_of_a_round(const Method& method) const {
    CANDELA_ASSIGN(const auto estimator, start(method, 1));
    if (estimator->unit_name() != "segments") return std::uint64_t{2};
    CANDELA_ASSIGN(const SettingsMap settings,
                   render::complete_integrator_settings(method.integrator, {}, method.settings));
    return static_cast<std::uint64_t>(std::stoull(settings.at("chains")));
  }
  // Rounds in the study's seconds. Chains have a bootstrap before the first round.
  Result<std::uint64_t> rounds_of(const Method& method, std::uint64_t round) const {
    constexpr std::uint64_t kMin = 1 << (kHiddenLevels - 1);
    CANDELA_ASSIGN(const auto estimator, start(method, 1));
    CANDELA_ASSIGN(const bench::Cost first, estimator->advance(round));
    std::uint64_t rounds = 1;
    double seconds = 0;  // of the rounds after the first
    while (seconds < sizes_.seconds() / 8) {
      rounds *= 2;
      CANDELA_ASSIGN(const bench::Cost cost, estimator->advance(rounds * round));
      seconds = cost.cpu_seconds - first.cpu_seconds;
    }
    const double each = seconds / static_cast<double>(rounds - 1);
    const double left = std::max(0.0, sizes_.seconds() - first.cpu_seconds);
    return std::max(kMin, static_cast<std::uint64_t>(left / each));
  }

  Result<void> measure(const Method& method, const Truth& truth) {
    CANDELA_ASSIGN(const std::uint64_t round, units_of_a_round(method));
    CANDELA_ASSIGN(const std::uint64_t rounds, rounds_of(method, round));
    std::vector<std::vector<Image>> images(kHiddenLevels);
    std::vector<double> seconds(kHiddenLevels);
    const auto seeds = static_cast<double>(request_.seeds);
    for (std::uint64_t seed = 1; seed <= request_.seeds; ++seed) {
      CANDELA_ASSIGN(const auto estimator, start(method, seed));
      for (std::uint64_t k = 0; k < kHiddenLevels; ++k) {
        CANDELA_ASSIGN(const bench::Cost cost, estimator->advance(rounds_at(rounds, k) * round));
        if (cost.rejected != 0) return internal_error(fmt::format("{} rejected samples", method.name));
        CANDELA_ASSIGN(bench::Snapshot snapshot, estimator->snapshot());
        images[k].push_back(std::move(snapshot.image));
        seconds[k] += cost.cpu_seconds / seeds;
      }
    }
    for (std::uint64_t k = 0; k < kHiddenLevels; ++k) {
      double whole = 0;
      for (const Image& image : images[k]) whole += relative_squared_error(image, truth) / seeds;
      const Image mean = mean_image(images[k], 0, images[k].size());
      const auto n = static_cast<double>(rounds_at(rounds, k) * round);
      add(method, n, "CPU seconds", seconds[k]);
      add(method, n, "relative squared error", whole);
      if (request_.seeds > 1) {
        // With variance V of one image and squared bias B: the error is V + B, that of the mean V / seeds +
        // B.
        const double noise = (whole - relative_squared_error(mean, truth)) * seeds / (seeds - 1);
        add(method, n, "noise", noise);
        add(method, n, "bias", whole - noise);
      }
      if (k + 1 == kHiddenLevels) {
        add_map(method.name, mean);
        request_.say(fmt::format("regularisation: {}, {}: error {:.3g} in {:.3g} CPU seconds", scene_.name,
                                 method.name, whole, seconds[k]));
      }
    }
    return {};
  }

  void add(const Method& method, double n, const std::string& quantity, double value) {
    results_.rows.push_back({"curves", scene_.name, method.name, kNone, n, quantity, value, kNone});
  }
  void add_map(const std::string& method, const Image& image) {
    std::vector<float> green;
    for (std::size_t i = 1; i < image.size(); i += 3) green.push_back(image[i]);
    results_.maps.push_back(
        {std::string(scene_.name) + ' ' + method, sizes_.side, sizes_.side, std::move(green)});
  }

  const Request& request_;
  const HiddenSizes sizes_;
  const HiddenLight& scene_;
  Results results_;
};

}  // namespace

Result<Results> run_regularisation(const Request& request) {
  std::vector<std::string> scene_names;
  for (const HiddenLight& scene : kHiddenLights) scene_names.emplace_back(scene.name);
  CANDELA_TRY(check_scenes(request, scene_names));
  Results results;
  for (const HiddenLight& scene : kHiddenLights) {
    if (!request.wants(scene.name)) continue;
    const std::string key = fmt::format("{} side {} seeds {} {}", build_id(), request.side, request.seeds,
                                        request.short_form ? "short" : "long");
    CANDELA_ASSIGN(Results of_scene, kept_results(request.folder, scene.name, key,
                                                  [&] { return HiddenTable(request, scene).run(); }));
    results.rows.insert(results.rows.end(), of_scene.rows.begin(), of_scene.rows.end());
    results.maps.insert(results.maps.end(), of_scene.maps.begin(), of_scene.maps.end());
  }
  return results;
}

}  // namespace candela::study
