#include "tests/bench/candela_study/radius_comparison.h"

#include <fmt/format.h>

#include <limits>

#include "tests/bench/candela_study/image_errors.h"
#include "tests/bench/candela_study/renders.h"

namespace candela::study {
namespace {

// Width of the picture: 1. Discs of this radius do not leave the cones of the spots.
constexpr double kFirstRadius = 1.0 / 6;
// Constant radii that the best one is chosen from: factors 1, 1/sqrt(2), 1/2 ... of the first.
constexpr int kFixedRadii = 7;
constexpr double fixed_factor(int k) {
  return k == 0 ? 1 : fixed_factor(k - 1) / std::numbers::sqrt2;
}

Result<Rendered> render_scene(const Request& request, const AnalyticScene& scene, std::uint32_t side,
                              const Method& method, double radius, std::uint64_t seed,
                              const std::vector<std::uint64_t>& counts) {
  Render render{.scene = scene.file,
                .width = side,
                .height = side,
                .integrator = method.integrator,
                .settings = method.settings,
                .seed = seed,
                .threads = request.threads};
  render.settings["radius_pixels"] = fmt::format("{:.9g}", radius * side);
  render.settings["light_paths"] = fmt::format("{:.9g}", scene.light_paths);
  return render_job(render, counts);
}

// Biases by radius, relative to the pixels' truth: lines between radii a quarter of an octave apart.
class BiasTable {
 public:
  BiasTable(const AnalyticScene& scene, std::uint32_t side) {
    constexpr int kPoints = 3;  // of a pixel's side
    for (int k = 0; k <= kSteps; ++k)
      biases_.push_back(relative_bias(scene, side, kFirstRadius * std::exp2(-0.25 * k), kPoints));
  }
  double at(std::size_t pixel, double factor) const {
    const double place = std::clamp(-4 * std::log2(factor), 0.0, kSteps - 1e-6);
    const auto k = static_cast<std::size_t>(place);
    const double share = place - static_cast<double>(k);
    return (1 - share) * biases_[k][pixel] + share * biases_[k + 1][pixel];
  }

 private:
  static constexpr int kSteps = 32;
  std::vector<std::vector<double>> biases_;
};

// The errors of pixels at constant radii.
struct FixedRadii {
  std::vector<double> best, best_radius;  // least squared error and its radius / first, by count
  std::vector<double> noise;  // standard error at the first radius after the last count, over the truth
};

Result<FixedRadii> render_fixed(const Request& request, const AnalyticScene& scene, std::uint32_t side,
                                const Truth& truth, const BiasTable& biases,
                                const std::vector<std::uint64_t>& counts) {
  FixedRadii fixed{std::vector<double>(counts.size(), std::numeric_limits<double>::infinity()),
                   std::vector<double>(counts.size()),
                   {}};
  const std::size_t pixels = std::size_t{side} * side;
  // A variance goes as one over the squared radius: all radii tell that of the first one.
  std::vector<double> variance(pixels);
  for (int k = 0; k < kFixedRadii; ++k) {
    const double factor = fixed_factor(k);
    CANDELA_ASSIGN(const Rendered rendered,
                   render_scene(request, scene, side, {"", "ppm", {{"alpha", "1"}}}, kFirstRadius * factor,
                                1000 + static_cast<std::uint64_t>(k), counts));
    for (std::size_t c = 0; c < counts.size(); ++c) {
      const double error = errors_of({rendered.images[c]}, truth).squared_error.mean();
      if (error >= fixed.best[c]) continue;
      fixed.best[c] = error;
      fixed.best_radius[c] = factor;
    }
    for (std::size_t i = 0; i < pixels; ++i) {
      const double ratio =
          static_cast<double>(rendered.images.back()[3 * i]) / static_cast<double>(truth.first[3 * i]);
      const double off = (ratio - 1 - biases.at(i, factor)) * factor;
      variance[i] += off * off / kFixedRadii;
    }
  }
  // The mean over a pixel and its neighbors: some sixty values, of one radius and place a few.
  for (std::uint32_t y = 0; y < side; ++y)
    for (std::uint32_t x = 0; x < side; ++x) {
      double sum = 0, count = 0;
      for (std::uint32_t v = y > 0 ? y - 1 : 0; v < std::min(y + 2, side); ++v)
        for (std::uint32_t u = x > 0 ? x - 1 : 0; u < std::min(x + 2, side); ++u) {
          sum += variance[std::size_t{v} * side + u];
          count += 1;
        }
      fixed.noise.push_back(std::sqrt(sum / count));
    }
  return fixed;
}

}  // namespace

std::vector<double> relative_bias(const AnalyticScene& scene, std::uint32_t side, double radius, int points) {
  constexpr int kRings = 12, kAngles = 24;
  std::vector<double> biases;
  for (std::uint32_t row = 0; row < side; ++row)
    for (std::uint32_t column = 0; column < side; ++column) {
      double sum = 0, truth = 0;
      for (int place = 0; place < points * points; ++place) {
        const double x = (column + (place % points + 0.5) / points) / side - 0.5;
        const double y = 0.5 - (row + (place / points + 0.5) / points) / side;
        truth += scene.irradiance(x, y);
        for (int i = 0; i < kRings; ++i)  // rings of one area
          for (int j = 0; j < kAngles; ++j) {
            const double r = radius * std::sqrt((i + 0.5) / kRings),
                         angle = 2 * std::numbers::pi * (j + 0.5) / kAngles;
            sum += scene.irradiance(x + r * std::cos(angle), y + r * std::sin(angle));
          }
      }
      biases.push_back(sum / (kRings * kAngles) / truth - 1);
    }
  return biases;
}

Result<Results> compare_radii(const Request& request, const RadiusComparison& comparison) {
  const std::uint32_t side = request.short_form ? 8 : 24;
  const std::uint64_t iterations = request.short_form ? 64 : comparison.iterations;
  const std::vector<std::uint64_t> counts = {iterations / 64, iterations / 8, iterations};
  std::vector<std::string> scene_names;
  for (const AnalyticScene& scene : analytic_scenes()) scene_names.push_back(scene.name);
  CANDELA_TRY(check_scenes(request, scene_names));
  Results results;
  for (const AnalyticScene& scene : analytic_scenes()) {
    if (!request.wants(scene.name)) continue;
    const auto& names = comparison.scenes;
    if (!names.empty() && std::find(names.begin(), names.end(), scene.name) == names.end()) continue;
    const Image truth_image = truth_of(scene, side);
    const Truth truth(truth_image, truth_image);
    const auto add = [&](const std::string& method, double n, const std::string& quantity, double value,
                         double standard_error) {
      results.rows.push_back(
          {comparison.part, scene.name, method, kNone, n, quantity, value, standard_error});
    };

    const BiasTable biases(scene, side);
    CANDELA_ASSIGN(const FixedRadii fixed, render_fixed(request, scene, side, truth, biases, counts));
    for (std::size_t c = 0; c < counts.size(); ++c) {
      add("best fixed radius", static_cast<double>(counts[c]), "squared error", fixed.best[c], kNone);
      add("best fixed radius", static_cast<double>(counts[c]), "median radius", fixed.best_radius[c], kNone);
    }
    for (const Method& method : comparison.methods) {
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
          Map decisions{scene.name + " " + method.name + " decisions", side, side, {}};
          double positives = 0, negatives = 0;
          for (std::size_t i = 0; i < layer.values.size(); ++i) {
            const auto bias = [&](double factor) { return biases.at(i, factor); };
            const float found = decision(static_cast<double>(layer.values[i]), bias, fixed.noise[i]);
            decisions.values.push_back(found);
            (found > 0 ? positives : negatives) += static_cast<double>(std::fabs(found));
          }
          const auto pixels = static_cast<double>(layer.values.size());
          add(method.name, n, "false positives", positives / pixels, kNone);
          add(method.name, n, "false negatives", negatives / pixels, kNone);
          results.maps.push_back({scene.name + " " + method.name, side, side, layer.values});
          results.maps.push_back(std::move(decisions));
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
