#include "worker/scene/emitters/point.h"

#include "worker/core/warp.h"
#include "worker/scene/emitters/place.h"
#include "worker/scene/transform.h"

namespace candela::scene {

DirectOutcome PointLight::sample_direct(const SurfaceHit& reference, Vec3 front, double /*rest*/, Vec2 /*u*/,
                                        DirectSample& out) const {
  return sample_place(
      position_, reference, front, [this](Vec3 /*d*/) { return intensity_; }, out);
}

bool PointLight::sample_emission(const SceneExtent& /*scene*/, double /*rest*/, Vec2 /*u_position*/,
                                 Vec2 u_direction, EmissionSample& out) const {
  out.delta_position = true;
  out.pdf_area = 1;
  out.radiance = intensity_;
  out.pdf_solid_angle = warp::kPdfUniformSphereSolidAngle;
  start_at(position_, normalize(warp::uniform_sphere(u_direction)), out);
  return true;
}

bool PointLight::pdf_emission(const SceneExtent& /*scene*/, Vec3 /*ng*/, Vec3 /*d*/,
                              EmissionDensity& out) const {
  return pdf_emission_place(warp::kPdfUniformSphereSolidAngle, out);
}

LightBounds PointLight::bounds(const Geometry& /*geometry*/) const {
  LightBounds out;
  out.box.add(Vec3d(position_));
  out.spread = math::kPi;
  out.strength = strength_;
  return out;
}

Result<PointLight> PointLight::build(const description::Object& object, TextureStore& /*textures*/) {
  if (object.find("position") != nullptr && object.find("to_world") != nullptr)
    return emitter_error(object, "give either position or to_world, not both", "position");
  const description::Vec3 p = object.get_vec3("position", {0, 0, 0});
  const Vec3d world = object.find("position") != nullptr
                          ? Vec3d{p[0], p[1], p[2]}
                          : Transform(object.get_transform("to_world")).translation();
  CANDELA_ASSIGN(const Spectrum intensity, read_quantity(object, "intensity"));
  return PointLight(Vec3(world), intensity);
}

}  // namespace candela::scene
