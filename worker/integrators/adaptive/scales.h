// Scales by a map of levels, for merging::run_iterations.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "worker/integrators/merging/scales.h"

namespace candela::integrators::adaptive {

// Kernels cannot take less.
inline constexpr double kLeastRadius = 1e-12;

template <class Mis>
class MappedScales {
 public:
  using Field = transport::ScaleMap;

  // radii: by level; all bytes of the map are below their number. map: has to outlive the scales.
  MappedScales(const merging::MergeRules& rules, const std::vector<double>& radii, std::string_view map,
               const UnitContext& context, double paths, const estimators::Techniques& techniques)
      : map_(map), width_(context.width), height_(context.height) {
    for (const double level : radii) {
      const double radius = std::max(level, kLeastRadius);
      scales_.push_back(merging::make_scale<Mis>(rules.kernel, radius, radius, paths, techniques));
    }
    search_ = search_radius(radii, map);
  }

  Field field(std::uint64_t /*iteration*/) const { return {scales_, map_, width_, height_}; }
  merging::SearchRadii search_radii(const Field& /*field*/) const { return {search_, search_}; }

 private:
  // The median over pixels, by which half of the queries meet no more cells than with a radius for all. At
  // least an eighth of the largest: a query visits rows of cells, and their number grows with the square.
  static float search_radius(const std::vector<double>& radii, std::string_view map) {
    std::array<std::uint64_t, 256> count{};
    for (const char level : map) ++count[static_cast<unsigned char>(level)];
    std::size_t largest = 0, median = 0;
    while (largest + 1 < radii.size() && count[largest] == 0) ++largest;
    for (std::uint64_t below = count[0]; 2 * below < map.size(); below += count[median]) ++median;
    return static_cast<float>(std::max({radii[median], radii[largest] / 8, kLeastRadius}));
  }

  std::vector<transport::MergeScale> scales_;
  std::string_view map_;
  std::uint32_t width_, height_;
  float search_ = 1;
};

}  // namespace candela::integrators::adaptive
