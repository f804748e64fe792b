// Mitsuba's sensor `irradiancemeter`: the power that arrives on a surface per area, on the side its normals
// point to. The film is laid over the surface: film position (x, y) over the film's size is a point of
// [0, 1]^2, which a map that keeps areas takes onto the shape.
//
// A pixel is the mean of pi L(p, omega) over points p of its part of the surface, uniform in area, and
// directions omega of density cos / pi. So the importance, in pixels^2 / (m^2 sr), is the film's area over
// the surface's.
//
// The map. A sphere: x is the angle around its z axis, y the height along it, from its top. A disk: x the
// squared radius, y the angle. A cylinder: x the angle, y the height. A rectangle: x and y along its sides. A
// mesh: y chooses the triangle by area; what is left of y, and x, the point on it.
#pragma once

#include <cstdint>
#include <optional>

#include "worker/scene/camera.h"
#include "worker/scene/emitters/distribution.h"
#include "worker/scene/hit.h"
#include "worker/scene/shapes/geometry.h"

namespace candela::scene {

class IrradianceMeter {
 public:
  // `shape`, of the geometry, is none of a shapegroup; rectangle: as build_shape gave it.
  IrradianceMeter(const Geometry& geometry, std::uint32_t shape, const std::optional<Rectangle>& rectangle,
                  std::uint32_t film_width, std::uint32_t film_height);

  static constexpr float kResponse = 3.14159265358979f;  // a ray's weight

  // Beyond the film's rim the surface's rim counts. u_lens chooses the direction.
  Ray ray(float film_x, float film_y, Vec2 u_lens) const;
  // A point of the surface uniform in area. False: the reference is behind it.
  bool sample(const SurfaceHit& reference, Vec2 u_lens, CameraSample& out) const;
  // The densities of ray() choosing the ray from the surface at `on` along the direction; false: it leaves
  // from behind. `on` has p, ng and, on a mesh, primitive and barycentric.
  bool density(const SurfaceHit& on, Vec3 direction, CameraDensity& out) const;
  void density(const CameraSample& sampled, CameraDensity& out) const;

  bool is_mesh() const { return triangles_.size() > 0 && !rectangle_; }
  bool is_on(const SurfaceHit& hit) const { return hit.shape == shape_; }
  // The surface point where a ray of ray() begins. `backwards`: the hit of its reverse, if there is one.
  SurfaceHit start_of(const Ray& ray, const SurfaceHit* backwards) const;

 private:
  struct Place {
    Vec3 p, ng;
    float error = 0;
  };
  Place place(Vec2 s) const;
  Vec2 square_place(const SurfaceHit& on) const;
  void nearest_triangle(Vec3d p, SurfaceHit& hit) const;
  float importance() const {
    return static_cast<float>(static_cast<double>(width_) * static_cast<double>(height_) / area_);
  }
  void fill(Vec3 p, Vec2 s, float cosine, CameraDensity& out) const;

  const Geometry* geometry_;
  ShapeRecord record_;
  std::uint32_t shape_;
  std::optional<Rectangle> rectangle_;
  Distribution triangles_;  // by area; of spheres, disks and cylinders empty
  double area_ = 0;
  float corner_error_ = 0;
  float width_, height_;
};

}  // namespace candela::scene
