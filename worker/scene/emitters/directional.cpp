#include "worker/scene/emitters/directional.h"

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

}  // namespace candela::scene
