// Normalised standard deviation of the 25 estimators that meet light in a medium at points or along beams,
// against the width of the kernel [Krivanek 2014, Fig. 1 and section 4].
//
// Parts "fixed" and "uniform": where the rays cross (nsd_axes.h), closed forms and simulation with distances
// that the renderer's homogeneous medium samples; n is the kernel's width in mean free paths. Part "many": 50
// light paths for one eye path. Part "slopes": of log(nsd) over log(width). Part "crossovers": the widths at
// which a point becomes better than a beam. Part "two beams": the four estimators that upbp has at 30
// degrees, with the renderer's kernels and closest points; n is the kernel's radius.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "common/rng/stream.h"
#include "tests/bench/candela_study/nsd_axes.h"
#include "tests/bench/candela_study/study.h"
#include "tests/statistical/moments.h"
#include "worker/scene/media/medium.h"
#include "worker/transport/beams.h"
#include "worker/transport/kernels.h"

namespace candela::study {
namespace {

using statistical::Moments;

constexpr double kOffsets = 4;  // mean free paths over which the rays' offset is uniform
constexpr Crossing kFixed{true, 2}, kUniform{false, 20};
constexpr double kMany = 50;
const std::vector<double> kSimulatedWidths = {0.1, 1, 4};

void add(std::vector<Row>& rows, const std::string& part, const std::string& problem,
         const std::string& method, double n, const std::string& quantity, double value, double error = 0) {
  rows.push_back({part, problem, method, kNone, n, quantity, value, error});
}

scene::Medium unit_medium() {
  const scene::Volume one{Spectrum{1, 1, 1}, nullptr};
  return scene::Medium(one, 1, one, scene::Phase());
}

// Distances to scattering, in mean free paths.
class Distances {
 public:
  double sample(rng::Stream& stream) const {
    const Vec2 u{stream.next_float(), stream.next_float()};
    return static_cast<double>(medium_.sample_distance(ray_, {1, 1, 1}, u).distance);
  }

 private:
  scene::Medium medium_ = unit_medium();
  Ray ray_{{0, 0, 0}, {1, 0, 0}};
};

// The score of a side along its own ray. cross: depth of the crossing; s: the sampled distance.
double axis_score(AxisKind kind, double cross, double u, double s) {
  const double low = std::max(0.0, cross - u / 2), high = cross + u / 2;  // the kernel's window on the ray
  switch (kind) {
    case AxisKind::point:
      return s >= low && s < high ? 1 / u : 0;
    case AxisKind::short_beam:
      return cross >= 0 && s > cross ? 1 : 0;
    case AxisKind::long_beam:
      return cross >= 0 ? std::exp(-cross) : 0;
    case AxisKind::blurred_short_beam:
      return std::max(0.0, std::min(high, s) - low) / u;
    case AxisKind::blurred_long_beam:
      return (std::exp(-low) - std::exp(-high)) / u;
  }
  return 0;
}

// Normalised standard deviation of samples, and how far the sum of squares leaves it uncertain.
struct Spread {
  Moments values, squares;
  void add(double value) {
    values.add(value);
    squares.add(value * value);
  }
  double nsd() const { return std::sqrt(values.variance()) / values.mean(); }
  double error() const {
    // The relative error of the square. The mean's error is one of the two terms.
    const double relative = std::hypot(squares.error() / squares.mean(), 2 * values.error() / values.mean());
    const double second = squares.mean() / (values.mean() * values.mean());
    return 0.5 * second * relative / nsd();
  }
};

// ---- the 25 estimators ----

void run_closed_form(const Request& request, std::vector<Row>& rows) {
  const int per_decade = request.short_form ? 2 : 12;
  for (const auto& [part, crossing] : {std::pair{"fixed", kFixed}, std::pair{"uniform", kUniform}})
    for (int i = -3 * per_decade; i <= per_decade; ++i) {
      const double u = std::pow(10, static_cast<double>(i) / per_decade);
      if (crossing.fixed && u > 2 * crossing.depth) break;
      for (const NsdEstimator& one : nsd_estimators()) {
        add(rows, part, "", one.name, u, "nsd", nsd(one, crossing, u, kOffsets));
        add(rows, part, "", one.name, u, "bias",
            axis_mean(one.light, crossing, u) * axis_mean(one.eye, crossing, u) - 1);
      }
    }
}

void run_simulated(const Request& request, std::vector<Row>& rows) {
  const std::uint64_t count = request.short_form ? 20000 : 10000000;
  const Distances distances;
  for (const auto& [part, crossing] : {std::pair{"fixed", kFixed}, std::pair{"uniform", kUniform}})
    for (const double u : kSimulatedWidths) {
      std::vector<Spread> spreads(nsd_estimators().size());
      rng::Stream stream(rng::key(1, crossing.fixed ? 1 : 2, static_cast<std::uint64_t>(u * 1000)));
      for (std::uint64_t i = 0; i < count; ++i) {
        const auto place = [&] {
          return crossing.fixed ? crossing.depth : crossing.depth * stream.next_double() - u / 2;
        };
        const double light = place(), eye = place();
        const double s = distances.sample(stream), t = distances.sample(stream);
        const double offset = kOffsets * (stream.next_double() - 0.5);
        const double kernel = std::abs(offset) < u / 2 ? 1 / u : 0;
        for (std::size_t k = 0; k < spreads.size(); ++k) {
          const NsdEstimator& one = nsd_estimators()[k];
          spreads[k].add(
              kernel == 0 ? 0 : axis_score(one.light, light, u, s) * axis_score(one.eye, eye, u, t) * kernel);
        }
      }
      // The true mean is e^-4 / D or 1 / (20^2 D), times the bias.
      const double truth =
          (crossing.fixed ? std::exp(-2 * crossing.depth) : std::pow(crossing.depth, -2)) / kOffsets;
      for (std::size_t k = 0; k < spreads.size(); ++k) {
        const NsdEstimator& one = nsd_estimators()[k];
        if (!(spreads[k].values.mean() > 0)) continue;  // nothing was hit
        const double mean = axis_mean(one.light, crossing, u) * axis_mean(one.eye, crossing, u) * truth;
        add(rows, part, "", one.name, u, "nsd, simulated", spreads[k].nsd(), spreads[k].error());
        add(rows, part, "", one.name, u, "mean over the exact one", spreads[k].values.mean() / mean,
            spreads[k].values.error() / mean);
      }
      request.say(fmt::format("upbp-nsd: {} crossing, width {}", part, u));
    }
}

void run_many(const Request& request, std::vector<Row>& rows) {
  const std::uint64_t count = request.short_form ? 2000 : 200000;
  constexpr double kWidth = 1;
  const Distances distances;
  std::vector<Spread> spreads(nsd_estimators().size());
  rng::Stream stream(rng::key(1, 3));
  for (std::uint64_t i = 0; i < count; ++i) {
    const double t = distances.sample(stream);
    std::vector<double> sums(spreads.size());
    for (int path = 0; path < static_cast<int>(kMany); ++path) {
      const double s = distances.sample(stream);
      if (!(std::abs(kOffsets * (stream.next_double() - 0.5)) < kWidth / 2)) continue;
      for (std::size_t k = 0; k < sums.size(); ++k)
        sums[k] += axis_score(nsd_estimators()[k].light, kFixed.depth, kWidth, s) / kWidth / kMany;
    }
    for (std::size_t k = 0; k < sums.size(); ++k)
      spreads[k].add(sums[k] * axis_score(nsd_estimators()[k].eye, kFixed.depth, kWidth, t));
  }
  for (std::size_t k = 0; k < spreads.size(); ++k) {
    const NsdEstimator& one = nsd_estimators()[k];
    add(rows, "many", "", one.name, kMany, "nsd", nsd_of_many(one, kFixed, kWidth, kOffsets, kMany));
    add(rows, "many", "", one.name, kMany, "nsd, simulated", spreads[k].nsd(), spreads[k].error());
    add(rows, "many", "", one.name, kMany, "floor", std::sqrt(axis_ratio(one.eye, kFixed, kWidth) - 1));
  }
}

// ---- what follows ----

void run_slopes(std::vector<Row>& rows) {
  for (const NsdEstimator& one : nsd_estimators()) {
    constexpr double kFrom = 0.9e-3, kTo = 1.1e-3;
    const double slope =
        std::log(nsd(one, kFixed, kTo, kOffsets) / nsd(one, kFixed, kFrom, kOffsets)) / std::log(kTo / kFrom);
    add(rows, "slopes", "", one.name, 1e-3, "slope", slope);
  }
}

// The width at which two kinds have one ratio; the first has the larger one below.
double crossover(AxisKind first, AxisKind second, const Crossing& crossing) {
  double low = 1e-6, high = crossing.fixed ? 2 * crossing.depth : 40;
  const auto above = [&](double u) {
    return axis_ratio(first, crossing, u) > axis_ratio(second, crossing, u);
  };
  if (!above(low) || above(high)) return kNone;
  for (int i = 0; i < 100; ++i) (above((low + high) / 2) ? low : high) = (low + high) / 2;
  return low;
}

void run_crossovers(std::vector<Row>& rows) {
  for (const auto& [part, crossing] : {std::pair{"fixed", kFixed}, std::pair{"uniform", kUniform}})
    for (const auto& [name, kind] :
         {std::pair{"short beam", AxisKind::short_beam}, std::pair{"long beam", AxisKind::long_beam},
          std::pair{"blurred short beam", AxisKind::blurred_short_beam},
          std::pair{"blurred long beam", AxisKind::blurred_long_beam}})
      if (const double width = crossover(AxisKind::point, kind, crossing); width == width)
        add(rows, "crossovers", part, name, kNone, "width", width);
}

// ---- two beams ----

constexpr double kDepth = 1.5, kSheet = 2;  // where they cross, and over what their offset is uniform
constexpr double kAngle = std::numbers::pi / 6;

// A sampled light ray along x, and an eye ray at kAngle to it that crosses it `offset` above.
struct Beams {
  Vec3 light_origin, light, eye_origin, eye;
  double s, t;  // sampled distances
};

double value(const auto& kernel, double squared, double radius) {
  return squared <= radius * radius ? static_cast<double>(kernel.value(static_cast<float>(squared))) : 0;
}
double through(bool is_long, double along, double sampled) {
  if (along < 0) return 0;
  return is_long ? std::exp(-along) : along < sampled ? 1 : 0;
}

struct BeamTechnique {
  std::string name;
  std::function<double(const Beams&, double radius)> score;
};

std::vector<BeamTechnique> beam_techniques() {
  using transport::Kernel;
  std::vector<BeamTechnique> all;
  all.push_back({"P-P3D", [](const Beams& b, double r) {
                   const Vec3d gap = Vec3d(b.light_origin) + Vec3d(b.light) * b.s - Vec3d(b.eye_origin) -
                                     Vec3d(b.eye) * b.t;
                   return value(transport::BallKernel(Kernel::constant, static_cast<float>(r)),
                                length_squared(gap), r);
                 }});
  for (const bool is_long : {false, true}) {
    const std::string suffix = is_long ? "l]" : "s]";
    all.push_back({"P-B2D[" + suffix, [=](const Beams& b, double r) {
                     const auto near = transport::project(b.eye_origin, b.eye,
                                                          b.light_origin + b.light * static_cast<float>(b.s));
                     return through(is_long, near.along, b.t) *
                            value(transport::DiscKernel(Kernel::constant, static_cast<float>(r)),
                                  near.distance_squared, r);
                   }});
    all.push_back({"B-P2D[" + suffix, [=](const Beams& b, double r) {
                     const auto near = transport::project(b.light_origin, b.light,
                                                          b.eye_origin + b.eye * static_cast<float>(b.t));
                     return through(is_long, near.along, b.s) *
                            value(transport::DiscKernel(Kernel::constant, static_cast<float>(r)),
                                  near.distance_squared, r);
                   }});
    all.push_back({std::string("B-B1D[") + (is_long ? "ll]" : "ss]"), [=](const Beams& b, double r) {
                     const auto near =
                         transport::closest_approach(b.light_origin, b.light, b.eye_origin, b.eye);
                     return through(is_long, near.along_a, b.s) * through(is_long, near.along_b, b.t) *
                            value(transport::LineKernel(Kernel::constant, static_cast<float>(r)),
                                  near.distance * near.distance, r) /
                            near.sine;
                   }});
  }
  return all;
}

// Expectations, over the truth e^-3: the kernel blurs along the beams, whose transmittances are exponentials.
double blur_of(const std::string& name, double radius) {
  if (name.starts_with("B-B1D")) return 1;
  if (name == "P-P3D") {
    const double k = radius / std::sin(kAngle / 2);
    return 3 * (k * std::cosh(k) - std::sinh(k)) / (k * k * k);
  }
  const double k = radius / std::tan(kAngle / 2);
  return 2 * std::cyl_bessel_i(1.0, k) / k;
}

void run_two_beams(const Request& request, std::vector<Row>& rows) {
  const std::uint64_t count = request.short_form ? 40000 : 4000000;
  const Distances distances;
  const double truth = std::exp(-2 * kDepth);
  for (const double radius : {0.4, 0.2, 0.1}) {
    const std::vector<BeamTechnique> techniques = beam_techniques();
    std::vector<Spread> spreads(techniques.size());
    rng::Stream stream(rng::key(1, 4, static_cast<std::uint64_t>(radius * 1000)));
    for (std::uint64_t i = 0; i < count; ++i) {
      Beams b;
      const Vec3d eye{std::cos(kAngle), std::sin(kAngle), 0};
      const double offset = kSheet * (stream.next_double() - 0.5);
      b.light_origin = {0, 0, 0};
      b.light = {1, 0, 0};
      b.eye = Vec3(eye);
      b.eye_origin = Vec3(Vec3d{kDepth, 0, offset} - eye * kDepth);
      b.s = distances.sample(stream);
      b.t = distances.sample(stream);
      for (std::size_t k = 0; k < techniques.size(); ++k)
        spreads[k].add(techniques[k].score(b, radius) * kSheet * std::sin(kAngle));
    }
    for (std::size_t k = 0; k < techniques.size(); ++k) {
      const std::string& name = techniques[k].name;
      add(rows, "two beams", "", name, radius, "expectation", truth * blur_of(name, radius));
      add(rows, "two beams", "", name, radius, "mean", spreads[k].values.mean(), spreads[k].values.error());
      if (spreads[k].values.mean() > 0)
        add(rows, "two beams", "", name, radius, "nsd", spreads[k].nsd(), spreads[k].error());
    }
    request.say(fmt::format("upbp-nsd: two beams, radius {}", radius));
  }
}

}  // namespace

Result<Results> run_upbp_nsd(const Request& request) {
  Results results;
  run_closed_form(request, results.rows);
  run_simulated(request, results.rows);
  run_many(request, results.rows);
  run_slopes(results.rows);
  run_crossovers(results.rows);
  run_two_beams(request, results.rows);
  return results;
}

}  // namespace candela::study
