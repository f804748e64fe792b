// ppm, mcppm and vcm over the share of light paths that are visible, on a detail of a floor. At one constant
// radius ppm and mcppm have the same expectation, so their variances compare them; vcm's is of another
// estimator, whose bias is smaller.
#include <fmt/format.h>

#include <vector>

#include "tests/bench/candela_study/renders.h"
#include "tests/bench/candela_study/study.h"
#include "tests/statistical/moments.h"

namespace candela::study {
namespace {

// Half widths of the floor: visible fractions from 15 % to 0.02 %.
std::vector<double> floors(bool short_form) {
  return short_form ? std::vector<double>{6} : std::vector<double>{2, 4, 8, 16, 32, 64};
}

const std::vector<Method>& methods() {
  static const std::vector<Method> all = {
      {"ppm", "ppm", {}},
      {"vcm", "vcm", {}},
      {"mcppm", "mcppm", {{"plan", "full"}}},
      {"mcppm, 4 mutations a path", "mcppm", {{"plan", "full"}, {"mutations_per_path", "4"}}},
      {"mcppm, 16 mutations a path", "mcppm", {{"plan", "full"}, {"mutations_per_path", "16"}}},
  };
  return all;
}

}  // namespace

Result<Results> run_metropolis_photons(const Request& request) {
  const std::uint32_t side = request.short_form ? 16 : 64;
  constexpr std::uint64_t kIterations = 32;
  Results results;
  for (const double floor : floors(request.short_form)) {
    for (const Method& method : methods()) {
      statistical::ImageMoments images;
      double seconds = 0;
      statistical::Moments fraction, acceptance;
      for (std::uint64_t seed = 1; seed <= request.seeds; ++seed) {
        Render render{.scene = "tests/bench/candela_study/scenes/patch.xml",
                      .width = side,
                      .height = side,
                      .integrator = method.integrator,
                      .settings = method.settings,
                      .seed = seed,
                      .threads = request.threads,
                      .parameters = {{"floor", fmt::format("{}", floor)}}};
        render.settings["radius_pixels"] = "2";
        render.settings["alpha"] = "1";
        CANDELA_ASSIGN(const Rendered rendered, render_job(render, {kIterations}));
        statistical::add_image(images, rendered.images[0]);
        seconds += rendered.cpu_seconds.back() / static_cast<double>(request.seeds);
        for (const auto& [name, value] : rendered.report.figures) {
          if (name == "visible fraction") fraction.add(value);
          if (name == "acceptance") acceptance.add(value);
        }
      }
      const auto add = [&](const std::string& quantity, double value) {
        results.rows.push_back(
            {"metropolis-photons", "patch", method.name, kNone, floor, quantity, value, kNone});
      };
      const double variance =
          request.seeds < 2 ? kNone
                            : statistical::relative_variance(images) * static_cast<double>(request.seeds);
      add("relative variance", variance);
      add("CPU seconds", seconds);
      add("variance x seconds", variance * seconds);
      if (fraction.count() > 0) add("visible fraction", fraction.mean());
      if (acceptance.count() > 0) add("acceptance", acceptance.mean());
      request.say(
          fmt::format("metropolis-photons: floor {}, {}: relative variance {:.3g} in {:.3g} CPU seconds",
                      floor, method.name, variance, seconds));
    }
  }
  return results;
}

}  // namespace candela::study
