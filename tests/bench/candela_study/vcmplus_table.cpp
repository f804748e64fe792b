// vcm and vcmplus to equal error: Table I of Lin et al. as ratios of iterations and of CPU seconds, on scenes
// of this repository. The target is the error that vcm has after all iterations.
#include <fmt/format.h>

#include <cmath>

#include "tests/bench/candela_study/image_errors.h"
#include "tests/bench/candela_study/renders.h"
#include "tests/bench/candela_study/study.h"

namespace candela::study {
namespace {

struct Scene {
  const char* name;
  const char* file;
  const char* reference;  // integrator: unbiased, with a noise that is small here
};
constexpr Scene kScenes[] = {
    {"cornell", "deploy/scenes/cornell/scene.xml", "bdpt"},
    {"studio", "deploy/scenes/studio/scene.xml", "bdpt"},
    {"torus", "tests/bench/torus/torus.xml", "path"},
    {"caustic", "tests/statistical/transport/caustic.xml", "bdpt"},
    {"sds", "tests/statistical/transport/sds.xml", "path"},
    {"textured-lamp", "tests/statistical/transport/textured-lamp.xml", "bdpt"},
    {"lamp-in-glass", "tests/statistical/transport/lamp-in-glass.xml", "bdpt"},
    {"mirror-glossy", "tests/statistical/transport/mirror-glossy.xml", "bdpt"},
};

// Where the curve first reaches `target`, by lines in log-log; NaN if it does not. Errors fall.
double reached(const std::vector<double>& places, const std::vector<double>& errors, double target) {
  for (std::size_t k = 0; k < errors.size(); ++k) {
    if (errors[k] > target) continue;
    if (k == 0) return places[0];
    const double share = std::log(errors[k - 1] / target) / std::log(errors[k - 1] / errors[k]);
    return places[k - 1] * std::pow(places[k] / places[k - 1], share);
  }
  return kNone;
}

}  // namespace

Result<Results> run_vcmplus_table(const Request& request) {
  const std::uint32_t side = request.short_form ? 12 : 48;
  const std::uint64_t reference_count = request.short_form ? 64 : 1024;
  std::vector<std::uint64_t> counts;
  for (std::uint64_t n = request.short_form ? 4 : 16; n <= (request.short_form ? 16 : 512); n *= 2)
    counts.push_back(n);
  Results results;
  for (const Scene& scene : kScenes) {
    const auto render = [&](const std::string& integrator, std::uint64_t seed) {
      return Render{.scene = scene.file,
                    .width = side,
                    .height = side,
                    .integrator = integrator,
                    .seed = seed,
                    .threads = request.threads};
    };
    std::vector<Image> references;
    for (const std::uint64_t seed : {900001, 900002}) {
      Render reference = render(scene.reference, seed);
      reference.sampler = "sobol";
      CANDELA_ASSIGN(auto images, render_images(reference, {reference_count}));
      references.push_back(std::move(images[0]));
    }
    const Truth truth(references[0], references[1]);
    const auto add = [&](const std::string& method, double n, const std::string& quantity, double value,
                         double standard_error) {
      if (std::isfinite(value))
        results.rows.push_back(
            {"vcmplus-table", scene.name, method, kNone, n, quantity, value, standard_error});
    };
    add(scene.reference, static_cast<double>(reference_count), "variance", truth.variance, kNone);

    struct Curve {
      std::vector<double> errors, seconds;
    };
    std::vector<double> places(counts.begin(), counts.end());
    std::vector<Curve> curves;
    for (const std::string integrator : {"vcm", "vcmplus"}) {
      Curve curve{std::vector<double>(counts.size()), std::vector<double>(counts.size())};
      std::vector<std::vector<Image>> images(counts.size());
      for (std::uint64_t seed = 1; seed <= request.seeds; ++seed) {
        CANDELA_ASSIGN(Rendered rendered, render_job(render(integrator, seed), counts));
        for (std::size_t k = 0; k < counts.size(); ++k) {
          images[k].push_back(std::move(rendered.images[k]));
          curve.seconds[k] += rendered.cpu_seconds[k] / static_cast<double>(request.seeds);
        }
        if (seed != 1) continue;
        for (const auto& [name, value] : rendered.report.figures)
          add(integrator, places.back(), name, value, kNone);
        for (const StateReport::Layer& layer : rendered.report.layers)
          if (layer.name == "radius")
            results.maps.push_back({std::string(scene.name) + " " + integrator, side, side, layer.values});
      }
      for (std::size_t k = 0; k < counts.size(); ++k) {
        const auto errors = errors_of(images[k], truth);
        curve.errors[k] = errors.squared_error.mean();
        add(integrator, places[k], "squared error", curve.errors[k],
            request.seeds > 2 ? errors.squared_error.error() : kNone);
        add(integrator, places[k], "CPU seconds", curve.seconds[k], kNone);
      }
      curves.push_back(std::move(curve));
    }
    const double target = curves[0].errors.back();
    add("vcmplus", places.back(), "iterations over vcm's",
        reached(places, curves[1].errors, target) / places.back(), kNone);
    add("vcmplus", places.back(), "CPU seconds over vcm's",
        reached(curves[1].seconds, curves[1].errors, target) / curves[0].seconds.back(), kNone);
    add("vcmplus", places.back(), "CPU seconds of an iteration over vcm's",
        curves[1].seconds.back() / curves[0].seconds.back(), kNone);
    add("vcmplus", places.back(), "squared error over vcm's", curves[1].errors.back() / target, kNone);
    request.say(fmt::format("vcmplus-table: {}", scene.name));
  }
  return results;
}

}  // namespace candela::study
