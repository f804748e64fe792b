#include "worker/integrators/mcppm/pilot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/base/work_monitor.h"
#include "worker/integrators/mcppm/photon_pass.h"
#include "worker/integrators/merging/chosen_radius.h"
#include "worker/integrators/merging/first_radius.h"
#include "worker/integrators/merging/scales.h"
#include "worker/integrators/plan_edge_content.h"

namespace candela::integrators::mcppm {
namespace {

constexpr double kPilotPixels = 256 * 256;
constexpr std::uint64_t kFewestPaths = 1 << 12, kMaxPaths = 1 << 14;
constexpr std::uint64_t kPilotSeed = 0x6d6370696c6f74ULL;  // "mcpilot"

}  // namespace

Result<VisibleFraction> visible_fraction(transport::EdgeContent between, const UnitContext& context,
                                         const merging::IterationOptions& options, double radius,
                                         const RunContext& run) {
  const double pixels = static_cast<double>(context.width) * context.height;
  const double shrink = std::sqrt(std::min(1.0, kPilotPixels / pixels));
  const auto side = [&](std::uint32_t of_film) {
    return std::max(1U, static_cast<std::uint32_t>(of_film * shrink));
  };
  UnitContext small{context.scene,       context.filter,
                    context.sampler,     rng::key(context.seed, kPilotSeed),
                    side(context.width), side(context.height)};
  small.camera_units = {static_cast<float>(context.width) / static_cast<float>(small.width),
                        static_cast<float>(context.height) / static_cast<float>(small.height)};
  const double small_pixels = static_cast<double>(small.width) * small.height;
  const double small_radius = merging::clamped_radius(radius * std::sqrt(pixels / small_pixels));
  const std::uint64_t light_paths =
      std::clamp(merging::light_path_count(options.merge, context), kFewestPaths, kMaxPaths);
  const estimators::PathCounts counts{small_pixels, static_cast<double>(light_paths),
                                      static_cast<float>(context.filter.radius())};
  const transport::MergeScale scale = merging::make_scale<transport::Unweighted>(
      options.merge.kernel, small_radius, small_radius, counts.light_paths, options.techniques);
  film::UnitFilm no_film({1, 1, 1}, 0);  // only counts
  RunContext quiet = run;
  quiet.progress = nullptr;
  GatherPlaces places;
  return with_edge_content(between, [&](auto form) -> Result<VisibleFraction> {
    work_step();
    CANDELA_TRY(places.trace<form()>(small, options, counts, scale, 0, 0, no_film, quiet, {}));
    work_step();
    CANDELA_ASSIGN(const std::vector<std::uint64_t> visible,
                   visible_paths<form()>({small, options, counts, places, 0, 0}, no_film, quiet, {}));
    return VisibleFraction{visible.size(), light_paths};
  });
}

IterationSize split_by(const VisibleFraction& fraction, const IterationSize& size, double pixels) {
  constexpr double kCorrelation = 10;  // tau
  const double all = static_cast<double>(size.light_paths) + static_cast<double>(size.mutations);
  const double b = std::max(fraction.value(), 1 / static_cast<double>(fraction.light_paths));
  const double c1 = (1 - b) / b, c2 = kCorrelation * std::max(pixels - 1, 0.0);
  const double best = c1 + c2 > 0 ? std::sqrt(c1) / (std::sqrt(c1) + std::sqrt(c2)) : 1;
  const double paths = std::clamp(std::max(best * all, kFewestVisible / b), 1.0, std::max(all, 1.0));
  const auto light_paths = static_cast<std::uint64_t>(paths + 0.5);
  return {light_paths, size.light_paths + size.mutations - light_paths};
}

bool decide_chains(const VisibleFraction& fraction, const IterationSize& size, bool full, Plan& plan) {
  const std::string found =
      fraction.visible == 0
          ? fmt::format("none of a pilot's {} light paths is visible to eye paths", fraction.light_paths)
          : fmt::format("{:.3g} % of a pilot's light paths are visible to eye paths", 100 * fraction.value());
  if (!full && fraction.value() > kMaxVisible) {
    plan.skip("chains of visible photons",
              fmt::format("{}: above {:.0f} % chains do not pay, so this is ppm; plan=full has them", found,
                          100 * kMaxVisible));
    return false;
  }
  plan.use("chains of visible photons", fmt::format("{}; an iteration has {} light paths and {} mutations",
                                                    found, size.light_paths, size.mutations));
  const double expected = fraction.value() * static_cast<double>(size.light_paths);
  if (expected < kFewestVisible)
    plan.note(
        "visible light paths",
        fmt::format("about {:.2g} of an iteration: fewer than {:.0f} mean dark iterations and noise that "
                    "mutations do not lower; more light_paths or a larger radius help",
                    expected, kFewestVisible));
  return true;
}

}  // namespace candela::integrators::mcppm
