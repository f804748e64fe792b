// Scales by a map of levels, for merging::run_iterations.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string_view>
#include <utility>
#include <vector>

#include "worker/integrators/integrator.h"
#include "worker/integrators/merging/scales.h"

namespace candela::integrators::adaptive {

// Kernels cannot take less.
inline constexpr double kMinRadius = 1e-12;

template <class Mis>
class MappedScales {
 public:
  using Field = transport::ScaleMap;

  // radii: of the first iteration, by level; all bytes of the map are below their number. rules, map and
  // techniques have to outlive the scales.
  MappedScales(const merging::MergeRules& rules, std::vector<double> radii, std::string_view map,
               const UnitContext& context, double paths, const estimators::Techniques& techniques)
      : rules_(rules),
        techniques_(techniques),
        paths_(paths),
        radii_(std::move(radii)),
        map_(map),
        width_(context.width),
        height_(context.height),
        search_(search_level(radii_, map)) {}

  // The scales of one iteration of the job, valid until the next call. The radii of all levels shrink alike,
  // by rules.alpha.
  Field field(std::uint64_t iteration) {
    const double disc = transport::disc_radius(1, iteration, rules_.alpha),
                 ball = transport::ball_radius(1, iteration, rules_.alpha);
    scales_.clear();
    for (const double radius : radii_)
      scales_.push_back(merging::make_scale<Mis>(rules_.kernel, at_least(radius * disc),
                                                 at_least(radius * ball), paths_, techniques_));
    search_radii_ = {static_cast<float>(at_least(search_ * disc)),
                     static_cast<float>(at_least(search_ * ball))};
    return {scales_, map_, width_, height_};
  }
  merging::SearchRadii search_radii(const Field& /*field*/) const { return search_radii_; }

 private:
  // The median over pixels, by which half of the queries meet no more cells than with a radius for all. At
  // least an eighth of the largest: a query visits rows of cells, and their number grows with the square.
  static double search_level(const std::vector<double>& radii, std::string_view map) {
    std::array<std::uint64_t, 256> count{};
    for (const char level : map) ++count[static_cast<unsigned char>(level)];
    std::size_t largest = 0, median = 0;
    while (largest + 1 < radii.size() && count[largest] == 0) ++largest;
    for (std::uint64_t below = count[0]; 2 * below < map.size(); below += count[median]) ++median;
    return std::max(radii[median], radii[largest] / 8);
  }

  static double at_least(double radius) { return std::max(radius, kMinRadius); }

  const merging::MergeRules& rules_;
  const estimators::Techniques& techniques_;
  double paths_;
  std::vector<double> radii_;
  std::string_view map_;
  std::uint32_t width_, height_;
  double search_;
  std::vector<transport::MergeScale> scales_;
  merging::SearchRadii search_radii_{};
};

}  // namespace candela::integrators::adaptive
