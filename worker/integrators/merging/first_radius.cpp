#include "worker/integrators/merging/first_radius.h"

#include "worker/scene/scene.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace candela::integrators::merging {
namespace {

constexpr int kGrid = 32;  // by as many rays

}  // namespace

double pixel_footprint(const UnitContext& context) {
  std::vector<double> areas;
  const Vec2 middle{0.5f, 0.5f};
  float weight = 1;
  for (int j = 0; j < kGrid; ++j) {
    for (int i = 0; i < kGrid; ++i) {
      const float x = (static_cast<float>(i) + 0.5f) * static_cast<float>(context.width) / kGrid;
      const float y = (static_cast<float>(j) + 0.5f) * static_cast<float>(context.height) / kGrid;
      const Ray ray = context.scene.camera_ray(x, y, middle, weight);
      scene::SurfaceHit hit;
      if (!context.scene.intersect(ray, hit)) continue;
      // Place of the rays one pixel further on, after the same distance, seen from this one.
      const auto offset = [&](float dx, float dy) {
        const Ray next = context.scene.camera_ray(x + dx, y + dy, middle, weight);
        return Vec3d(next.origin) - Vec3d(ray.origin) +
               (Vec3d(next.direction) - Vec3d(ray.direction)) * static_cast<double>(hit.distance);
      };
      areas.push_back(length(cross(offset(1, 0), offset(0, 1))));
    }
  }
  if (areas.empty()) return 0;
  const auto middle_one = areas.begin() + static_cast<std::ptrdiff_t>(areas.size() / 2);
  std::nth_element(areas.begin(), middle_one, areas.end());
  return std::sqrt(*middle_one);
}

double first_radius(const UnitContext& context, double fraction, double pixels) {
  const double footprint = pixels > 0 ? pixel_footprint(context) : 0;
  const double radius =
      footprint > 0 ? pixels * footprint : fraction * static_cast<double>(context.scene.features().radius);
  return clamped_radius(radius);
}

double clamped_radius(double radius) {
  return std::clamp(radius, kMinRadius, kGreatestRadius);
}

}  // namespace candela::integrators::merging
