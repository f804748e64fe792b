// All emitters of a scene, and the choice among them at a reference point.
//
// Up to kImportanceEmitters of them, each gets an importance at the reference: an estimate of the irradiance
// it would give unoccluded, from its power, distance and the cosines at both ends bounded over its extent (in
// the manner of Conty Estevez and Kulla 2018, and pbrt-v4's light bounds). It is zero only where the emitter
// cannot light the point at all. A tenth of the choice goes evenly to all that are not zero, since an
// irradiance says little about a glossy lobe. Beyond that number the choice follows power alone.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "worker/scene/emitter.h"
#include "worker/scene/emitters/area_lights.h"
#include "worker/scene/emitters/environment.h"
#include "worker/scene/textures/texture.h"

namespace candela::scene {

class LightSampler {
 public:
  static constexpr std::size_t kImportanceEmitters = 64;

  // The geometry must outlive this. Emitters are numbered in the order of adding.
  explicit LightSampler(const Geometry& geometry) : geometry_(&geometry) {}

  // `shape` is in the geometry already; rectangle: as build_shape gave it, null otherwise.
  std::uint32_t add_area(std::uint32_t shape, const Rectangle* rectangle, const ColorTexture& radiance);
  std::uint32_t add_point(Vec3 position, Spectrum intensity);
  // direction: unit, the way the light travels; irradiance on a surface facing it.
  std::uint32_t add_directional(Vec3 direction, Spectrum irradiance);
  std::uint32_t add_environment(Environment environment);
  // After the last add: distances and powers need the scene's extent.
  void finish();

  std::size_t size() const { return emitters_.size(); }

  // Radiance of area emitter `emitter` from its surface at `hit` towards wo.
  Spectrum emitted(const SurfaceHit& hit, Vec3 wo) const {
    const Emitter& e = emitters_[hit.emitter];
    return dot(wo, hit.ng) > 0 ? e.radiance.eval(hit.uv) : Spectrum();
  }
  Spectrum environment(Vec3 d) const;

  // See Scene.
  bool sample(const SurfaceHit& reference, Vec3 front, float u_select, Vec2 u, DirectSample& out) const;
  float pdf_solid_angle(const SurfaceHit& reference, Vec3 front, const SurfaceHit& hit) const;
  float pdf_environment_solid_angle(const SurfaceHit& reference, Vec3 front, Vec3 d) const;

  // The discrete probability of choosing `emitter` at the reference; what sample() uses.
  float prob(Vec3 reference, Vec3 front, std::uint32_t emitter) const;

 private:
  enum class Kind : std::uint8_t { rectangle, sphere, mesh, point, directional, environment };
  struct Emitter {
    Kind kind{};
    std::uint32_t index = 0;  // of its kind
    ColorTexture radiance;    // area; constant: intensity (point) or irradiance (directional)
    Vec3 vector;              // position (point), direction of travel (directional)
    // Bounds for importance, of what has an extent.
    Vec3 center;
    float radius = 0;
    Vec3 axis;  // of the cone of normals
    float cos_spread = -1, sin_spread = 0;
    float strength = 0;  // importance at unit distance and cosines
    double power = 0;
  };

  float importance(const Emitter& emitter, Vec3 p, Vec3 front) const;
  // Fills importances; the sum, and the number above zero.
  float importances(Vec3 p, Vec3 front, float* out, std::uint32_t& positive_count) const;
  static float share(float importance, float sum, std::uint32_t positive_count);
  // rest: what is left of u, uniform in [0, 1) again.
  bool select(Vec3 p, Vec3 front, double u, std::uint32_t& emitter, float& prob, double& rest) const;
  bool by_importance() const { return emitters_.size() <= kImportanceEmitters; }

  const Geometry* geometry_;
  std::vector<Emitter> emitters_;
  std::vector<RectangleLight> rectangles_;
  std::vector<SphereLight> spheres_;
  std::vector<std::uint32_t> sphere_records_;  // parallel to spheres_
  std::vector<MeshLight> meshes_;
  std::vector<Environment> environments_;
  std::vector<std::uint32_t> environment_emitters_;  // parallel to environments_
  Distribution powers_;
};

}  // namespace candela::scene
