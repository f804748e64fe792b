// All emitters of a scene, and the choice among them at a reference point.
//
// Up to kImportanceEmitters of them, each gets an importance at the reference: an estimate of the irradiance
// it would give unoccluded, from its power, distance and the cosines at both ends bounded over its extent (in
// the manner of Conty Estevez and Kulla 2018, and pbrt-v4's light bounds). It is zero only where the emitter
// cannot light the point at all. A tenth of the choice goes evenly to all that are not zero, since an
// irradiance says little about a glossy lobe. Beyond that number a light tree stands for all emitters that
// have a place, chosen beside the directional ones and the environments in the same way.
//
// Light paths have no reference: for them emitters are chosen by power (light_emission.cpp).
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "worker/scene/emitter.h"
#include "worker/scene/emitters/area_lights.h"
#include "worker/scene/emitters/environment.h"
#include "worker/scene/emitters/spot.h"
#include "worker/scene/light_tree.h"
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
  std::uint32_t add_spot(SpotLight spot);
  // After the last add: distances and powers need the scene's extent.
  // choose_by_power: no tree, for measurements against it.
  void finish(bool choose_by_power = false);

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

  bool sample_emission(float u_select, Vec2 u_position, Vec2 u_direction, EmissionSample& out) const;
  bool pdf_emission(const SurfaceHit& hit, Vec3 d, EmissionDensity& out) const;
  bool pdf_emission(const DirectSample& light, EmissionDensity& out) const;
  bool pdf_emission_environment(Vec3 to_light, EmissionDensity& out) const;
  // Power in W, towards the scene; analytic where radiance does not vary, by a fixed quadrature otherwise.
  Spectrum power(std::uint32_t emitter) const;
  // The discrete probability with which sample_emission chooses the emitter.
  float prob_emission(std::uint32_t emitter) const;

  // The discrete probability of choosing `emitter` at the reference; what sample() uses.
  float prob(Vec3 reference, Vec3 front, std::uint32_t emitter) const;

 private:
  enum class Kind : std::uint8_t {
    rectangle,
    sphere,
    disk,
    cylinder,
    mesh,
    point,
    spot,
    directional,
    environment
  };
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
    float strength = 0;           // importance at unit distance and cosines
    std::uint32_t shape = kNone;  // of an area emitter, in the geometry
  };
  // The choice made, and what is left of its number.
  struct Choice {
    std::uint32_t emitter = kNone;
    float prob = 0;
    double rest = 0;
  };

  static bool infinite(const Emitter& emitter) {
    return emitter.kind == Kind::directional || emitter.kind == Kind::environment;
  }
  float importance(const Emitter& emitter, Vec3 p, Vec3 front) const;
  // Fills importances; the sum, and the number above zero.
  float importances(Vec3 p, Vec3 front, float* out, std::uint32_t& positive_count) const;
  static float share(float even, float importance, float sum, std::uint32_t positive_count);
  bool select(Vec3 p, Vec3 front, double u, Choice& choice) const;
  bool select_by_tree(Vec3 p, Vec3 front, double u, Choice& choice) const;
  float prob_by_tree(Vec3 p, Vec3 front, std::uint32_t emitter) const;
  LightBounds bounds(std::uint32_t emitter) const;

  double area(const Emitter& emitter) const;
  // A point uniform in area on an area emitter, its uv filled in where the radiance looks at it.
  void sample_area(const Emitter& emitter, double u_triangle, Vec2 u, LightPoint& out) const;
  void find_uv(const Emitter& emitter, LightPoint& point) const;
  Spectrum mean_radiance(const Emitter& emitter) const;
  // Probability of choosing any environment for a light path.
  float prob_emission_environments() const;
  bool by_importance() const { return emitters_.size() <= kImportanceEmitters; }

  const Geometry* geometry_;
  std::vector<Emitter> emitters_;
  std::vector<RectangleLight> rectangles_;
  std::vector<SphereLight> spheres_;
  std::vector<DiskLight> disks_;
  std::vector<CylinderLight> cylinders_;
  std::vector<SpotLight> spots_;
  std::vector<MeshLight> meshes_;
  std::vector<Environment> environments_;
  std::vector<std::uint32_t> environment_emitters_;  // parallel to environments_
  std::vector<std::uint32_t> infinite_;  // what the tree does not hold; filled where there is a tree
  LightTree tree_;
  Distribution powers_;  // of luminance
  Vec3d center_;         // of a sphere that holds the scene
  double radius_ = 0;
};

}  // namespace candela::scene
