#include "tests/bench/candela_study/radius_comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "tests/bench/candela_study/image_errors.h"
#include "tests/bench/candela_study/renders.h"

namespace candela::study {
namespace {

// Width of the picture: 1. Discs of this radius do not leave the cones of the spots.
constexpr double kFirstRadius = 1.0 / 6;
// Constant radii that the best one is chosen from: factors 1, 1/sqrt(2), 1/2 ... of the first.
constexpr int kFixedRadii = 7;

Result<Rendered> render_scene(const Request& request, const AnalyticScene& scene, std::uint32_t side,
                              const RadiusMethod& method, double radius, std::uint64_t seed,
                              const std::vector<std::uint64_t>& counts) {
  Render render{.scene = scene.file,
                .width = side,
                .height = side,
                .integrator = method.integrator,
                .settings = method.settings,
                .seed = seed,
                .threads = request.threads};
  render.settings["radius_pixels"] = fmt::format("{:.9g}", radius * side);
  return render_job(render, counts);
}

// Share of the pixels that `counts` holds for among those that `belongs` holds for.
template <class Belongs, class Counts>
double share(std::size_t pixels, const Belongs& belongs, const Counts& counts) {
  double all = 0, counted = 0;
  for (std::size_t i = 0; i < pixels; ++i) {
    if (!belongs(i)) continue;
    all += 1;
    counted += counts(i) ? 1 : 0;
  }
  return all > 0 ? counted / all : kNone;
}

}  // namespace

std::vector<double> relative_bias(const AnalyticScene& scene, std::uint32_t side, double radius) {
  constexpr int kRings = 12, kAngles = 24;
  std::vector<double> biases;
  for (std::uint32_t row = 0; row < side; ++row)
    for (std::uint32_t column = 0; column < side; ++column) {
      const double x = (column + 0.5) / side - 0.5, y = 0.5 - (row + 0.5) / side;
      double sum = 0;
      for (int i = 0; i < kRings; ++i)  // rings of one area
        for (int j = 0; j < kAngles; ++j) {
          const double r = radius * std::sqrt((i + 0.5) / kRings),
                       angle = 2 * std::numbers::pi * (j + 0.5) / kAngles;
          sum += scene.irradiance(x + r * std::cos(angle), y + r * std::sin(angle));
        }
      biases.push_back(sum / (kRings * kAngles) / scene.irradiance(x, y) - 1);
    }
  return biases;
}

Result<Results> compare_radii(const Request& request, const RadiusComparison& comparison) {
  const std::uint32_t side = request.short_form ? 8 : 24;
  const std::uint64_t iterations = request.short_form ? 64 : comparison.iterations;
  const std::vector<std::uint64_t> counts = {iterations / 64, iterations / 8, iterations};
  Results results;
  for (const AnalyticScene& scene : analytic_scenes()) {
    const auto& names = comparison.scenes;
    if (!names.empty() && std::find(names.begin(), names.end(), scene.name) == names.end()) continue;
    const Image truth_image = truth_of(scene, side);
    const Truth truth(truth_image, truth_image);
    const auto add = [&](const std::string& method, double n, const std::string& quantity, double value,
                         double standard_error) {
      if (!std::isfinite(value)) return;  // there are no such pixels
      results.rows.push_back(
          {comparison.part, scene.name, method, kNone, n, quantity, value, standard_error});
    };

    std::vector<double> best(counts.size(), std::numeric_limits<double>::infinity()),
        best_radius(counts.size());
    for (int k = 0; k < kFixedRadii; ++k) {
      const double factor = std::exp2(-0.5 * k);
      CANDELA_ASSIGN(const Rendered rendered,
                     render_scene(request, scene, side, {"", "ppm", {{"alpha", "1"}}}, kFirstRadius * factor,
                                  1000, counts));
      for (std::size_t c = 0; c < counts.size(); ++c) {
        const double error = errors_of({rendered.images[c]}, truth).squared_error.mean();
        if (error >= best[c]) continue;
        best[c] = error;
        best_radius[c] = factor;
      }
    }
    for (std::size_t c = 0; c < counts.size(); ++c) {
      add("best fixed radius", static_cast<double>(counts[c]), "squared error", best[c], kNone);
      add("best fixed radius", static_cast<double>(counts[c]), "median radius", best_radius[c], kNone);
    }

    const std::vector<double> biases = relative_bias(scene, side, kFirstRadius);
    for (const RadiusMethod& method : comparison.methods) {
      std::vector<std::vector<Image>> images(counts.size());
      for (std::uint64_t seed = 1; seed <= request.seeds; ++seed) {
        CANDELA_ASSIGN(Rendered rendered,
                       render_scene(request, scene, side, method, kFirstRadius, seed, counts));
        for (std::size_t c = 0; c < counts.size(); ++c) images[c].push_back(std::move(rendered.images[c]));
        if (seed != 1) continue;
        const auto n = static_cast<double>(iterations);
        for (const auto& [name, value] : rendered.report.figures) add(method.name, n, name, value, kNone);
        for (const StateReport::Layer& layer : rendered.report.layers) {
          if (layer.name != "radius") continue;
          results.maps.push_back({scene.name + " " + method.name, side, side, layer.values});
          const auto shrunk = [&](std::size_t i) { return layer.values[i] < 0.999F; };
          add(method.name, n, "false shrinks",
              share(
                  biases.size(), [&](std::size_t i) { return std::fabs(biases[i]) < 0.01; }, shrunk),
              kNone);
          add(method.name, n, "missed",
              share(
                  biases.size(), [&](std::size_t i) { return std::fabs(biases[i]) > 0.1; },
                  [&](std::size_t i) { return !shrunk(i); }),
              kNone);
        }
      }
      for (std::size_t c = 0; c < counts.size(); ++c) {
        const auto n = static_cast<double>(counts[c]);
        const ImageErrors errors = errors_of(images[c], truth);
        const double known = request.seeds > 2 ? 1 : kNone;
        add(method.name, n, "squared error", errors.squared_error.mean(),
            known * errors.squared_error.error());
        if (request.seeds < 2) continue;
        add(method.name, n, "variance", errors.variance.mean(), known * errors.variance.error());
        add(method.name, n, "squared bias", errors.squared_bias.mean(), known * errors.squared_bias.error());
      }
    }
    request.say(fmt::format("{}: {}", comparison.part, scene.name));
  }
  return results;
}

}  // namespace candela::study
