#include "worker/scene/emitters/emitter_set.h"

#include <algorithm>

namespace candela::scene {

Emitter make_area_light(const Geometry& geometry, std::uint32_t shape, const Rectangle* rectangle,
                        const ColorTexture& radiance) {
  const ShapeRecord& record = geometry.shapes[shape];
  const auto light = [&]<class Surface>(Surface surface, const SurfaceExtent& extent) {
    return AreaLight<Surface>(std::move(surface), extent, geometry, shape, radiance);
  };
  const auto round = [&]<class Surface>(const Surface& surface) { return light(surface, surface.extent()); };
  if (record.sphere != kNone) return round(SphereSurface(geometry.spheres[record.sphere].sphere));
  if (record.disk != kNone) return round(DiskSurface(geometry.disks[record.disk].disk));
  if (record.cylinder != kNone) return round(CylinderSurface(geometry.cylinders[record.cylinder].cylinder));
  const SurfaceExtent extent = extent_of_triangles(geometry, shape);
  if (rectangle != nullptr) return light(RectangleSurface(*rectangle, corner_error(geometry, shape)), extent);
  return light(MeshSurface(geometry, shape), extent);
}

std::uint32_t EmitterSet::add(Emitter emitter) {
  const auto index = static_cast<std::uint32_t>(emitters_.size());
  if (std::holds_alternative<Environment>(emitter)) environments_.push_back(index);
  emitters_.push_back(std::move(emitter));
  return index;
}

double EmitterSet::weight_of_power(std::uint32_t i, const SceneExtent& scene) const {
  const double least = visit(i, [](const auto& e) {
    if constexpr (requires { e.min_power(); })
      return e.min_power();
    else
      return 0.0;
  });
  const double p = std::max(static_cast<double>(luminance(power(i, scene))), least);
  return p >= 0 ? std::min(p, 1e200) : 0.0;
}

std::optional<LightBounds> EmitterSet::bounds(std::uint32_t i, const Geometry& geometry) const {
  return visit(i, [&](const auto& e) -> std::optional<LightBounds> {
    if constexpr (requires { e.bounds(geometry); }) {
      LightBounds bounds = e.bounds(geometry);
      bounds.emitter = i;
      return bounds;
    } else {
      return std::nullopt;
    }
  });
}

}  // namespace candela::scene
