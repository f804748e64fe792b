#include "worker/scene/emitters/directional.h"

#include <cmath>

#include "worker/scene/transform.h"

namespace candela::scene {

DirectOutcome DirectionalLight::sample_direct(const SurfaceHit& reference, Vec3 front, double /*rest*/,
                                              Vec2 /*u*/, DirectSample& out) const {
  out.infinite = true;
  out.ng = {};
  out.wi = -direction_;
  out.radiance = irradiance_;
  out.pdf_solid_angle = 1;
  out.delta = true;
  if (!faces(front, out.wi)) {
    out.radiance = {};
    return DirectOutcome::dark;
  }
  out.shadow_ray = spawn_ray(reference, out.wi);
  return out.radiance.is_black() ? DirectOutcome::dark : DirectOutcome::sampled;
}

bool DirectionalLight::sample_emission(const SceneExtent& scene, double /*rest*/, Vec2 u_position,
                                       Vec2 /*u_direction*/, EmissionSample& out) const {
  out.radiance = irradiance_;
  out.infinite = out.delta_direction = true;
  out.pdf_solid_angle = 1;
  out.pdf_area = scene.pdf_disk_area();
  scene.start_outside(direction_, u_position, out);
  return true;
}

bool DirectionalLight::pdf_emission(const SceneExtent& scene, Vec3 /*ng*/, Vec3 /*d*/,
                                    EmissionDensity& out) const {
  out.cosine = 1;
  out.infinite = out.delta_direction = true;
  out.pdf_area = scene.pdf_disk_area();
  out.pdf_solid_angle = 1;
  return out.prob > 0;
}

Result<DirectionalLight> DirectionalLight::build(const description::Object& object,
                                                 TextureStore& /*textures*/) {
  if (object.find("direction") != nullptr && object.find("to_world") != nullptr)
    return emitter_error(object, "give either direction or to_world, not both", "direction");
  const description::Vec3 d = object.get_vec3("direction", {0, 0, 1});
  const Vec3d world = object.find("direction") != nullptr
                          ? Vec3d{d[0], d[1], d[2]}
                          : Transform(object.get_transform("to_world")).vector({0, 0, 1});
  const double l = length(world);
  if (!(l > 0) || !std::isfinite(l)) return emitter_error(object, "direction has no length", "direction");
  CANDELA_ASSIGN(const Spectrum irradiance, read_quantity(object, "irradiance"));
  return DirectionalLight(Vec3(world / l), irradiance);
}

}  // namespace candela::scene
