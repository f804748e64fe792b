// Gathers the facts of a built scene that a plan, the pilot and `check` ask for.
#include <algorithm>
#include <cmath>
#include <vector>

#include "worker/scene/scene_builder.h"
#include "worker/scene/shared_faces.h"
#include "worker/scene/thick_medium.h"

namespace candela::scene {

void SceneBuilder::finish_features() {
  features_.triangles = geometry_.indices.size();
  features_.spheres = static_cast<std::uint32_t>(geometry_.spheres.size());
  features_.disks = static_cast<std::uint32_t>(geometry_.disks.size());
  features_.cylinders = static_cast<std::uint32_t>(geometry_.cylinders.size());
  features_.instances = static_cast<std::uint32_t>(geometry_.instances.size());
  features_.shapes = static_cast<std::uint32_t>(geometry_.shapes.size());
  features_.textures = textures_.texture_count();
  features_.all_bsdfs_delta = all_delta_ && !geometry_.shapes.empty();
  features_.emitters = static_cast<std::uint32_t>(lights_.size());
  for (std::uint32_t i = 0; i < lights_.size(); ++i) {
    features_.environments += lights_.is_environment(i) ? 1 : 0;
    features_.infinite_emitters += lights_.infinite(i) ? 1 : 0;
  }
  emitter_media_.resize(lights_.size(), kNone);
  features_.media = static_cast<std::uint32_t>(media_.size());
  for (std::uint32_t i = 0; i < media_.size(); ++i) {
    features_.any_scattering_medium |=
        media_[i].max_albedo().max_component() > 0 && media_[i].max_sigma_t().max_component() > 0;
    features_.any_heterogeneous_medium |= !media_[i].homogeneous();
  }
  std::vector<bool> lets_through;
  for (const ShapeRecord& shape : geometry_.shapes)
    lets_through.push_back(shape.medium_interface != kNone || bsdfs_[shape.bsdf].facts().transmissive);
  constexpr std::size_t kMaxSharedFaces = 8;
  for (const auto& [first, second] : find_shared_faces(geometry_, lets_through, kMaxSharedFaces))
    features_.shared_faces.emplace_back(shape_places_[first], shape_places_[second]);
  const ThickMedium lasting = thickest_medium(media_, geometry_);
  features_.lasting_fraction = static_cast<float>(lasting.fraction);
  features_.lasting_thickness = static_cast<float>(lasting.thickness);
  features_.radius = static_cast<float>(geometry_.bounds.radius());
  for (const Vec3d p : {geometry_.bounds.low, geometry_.bounds.high}) {
    if (geometry_.bounds.empty()) break;
    features_.largest_coordinate =
        std::max(features_.largest_coordinate,
                 static_cast<float>(std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)})));
  }
}

}  // namespace candela::scene
