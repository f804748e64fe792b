// All shapes of a scene joined into flat arrays: what Embree is built from, and what a hit is computed from.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "worker/core/vec.h"
#include "worker/scene/bounds.h"
#include "worker/scene/hit.h"
#include "worker/scene/shapes/shape.h"
#include "worker/scene/transform.h"

namespace candela::scene {

// All that a hit on a flat, untextured triangle needs, in one cache line.
struct alignas(64) Triangle {
  Vec3 v0, v1, v2;
  Vec3 ng;  // unit
  std::uint32_t shape = 0;
  float plane_error = 0;  // how far from its plane a point must start for Embree not to meet it again
  bool smooth = false;    // has shading normals
  bool mapped = false;    // has texture coordinates that somebody reads
  bool partials = false;  // its bsdf reads dp_du and dp_dv
};

struct ShapeRecord {
  std::uint32_t bsdf = kNone;
  std::uint32_t emitter = kNone;
  std::uint32_t medium_interface = kNone;
  std::uint32_t first_triangle = 0, triangle_count = 0;  // in Geometry::triangles
  // A shape that is not made of triangles is one primitive, in Geometry's array of its kind.
  std::uint32_t sphere = kNone, disk = kNone, cylinder = kNone;
  bool reads_uv = false;         // a texture or an anisotropic bsdf depends on the parameterization
  bool reads_partials = false;   // hits need dp_du and dp_dv
  bool reads_mean_edge = false;  // a texture looks at Geometry::mean_edges
};

struct SphereRecord {
  Sphere sphere;
  std::uint32_t shape = 0;
};
struct DiskRecord {
  Disk disk;
  std::uint32_t shape = 0;
};
struct CylinderRecord {
  Cylinder cylinder;
  std::uint32_t shape = 0;
};

enum class PrimitiveKind : std::uint8_t { triangle, sphere, disk, cylinder };
inline constexpr std::size_t kPrimitiveKinds = 4;

// Shapes that follow each other: those of the scene itself, or those of a shapegroup.
struct Group {
  struct Range {
    std::uint32_t first = 0, count = 0;
  };
  std::array<Range, kPrimitiveKinds> primitives;  // by kind, in Geometry's array of it
  Bounds bounds;
};

struct Instance {
  std::uint32_t group = 0;
  Transform to_world;
  double inverse_norm = 0;  // Frobenius, of the inverse: how much longer a step in the world is in the group
  Bounds bounds;            // in the world
};

// A number or a color that some meshes have at their vertices or on their faces.
struct Attribute {
  bool of_faces = false;
  std::vector<Spectrum> values;      // of one mesh after the other
  std::vector<std::uint32_t> first;  // by shape: add a vertex or triangle index (mod 2^32)
  // Bounds over all meshes of the scene, known before any mesh is added.
  Spectrum minimum, maximum;
};

struct Geometry {
  std::vector<Vec3> positions;  // with one element more than used: Embree reads 16 bytes at each
  std::vector<Vec3> normals;    // as positions; empty where no shape is smooth
  std::vector<Vec2> uvs;        // as positions; empty where nobody reads them
  std::vector<std::array<std::uint32_t, 3>> indices;
  std::vector<Triangle> triangles;  // parallel to indices
  std::vector<SphereRecord> spheres;
  std::vector<DiskRecord> disks;
  std::vector<CylinderRecord> cylinders;
  std::vector<ShapeRecord> shapes;
  std::map<std::string, Attribute, std::less<>> attributes;
  std::vector<double> mean_edges;  // of the triangles of a shape, where somebody reads it
  std::vector<Group> groups{1};  // the first is the scene itself, the others are met through instances alone
  std::vector<Instance> instances;
  Bounds bounds;  // of the scene and its instances

  // Takes the bounds of the attributes of a shape that will be added.
  void expect(const std::vector<loaders::MeshAttribute>& shape_attributes);
  // Appends; record's primitives are filled in.
  void add(Shape shape, ShapeRecord record);
  // Shapes added from here on are those of a new group; its index.
  std::uint32_t begin_group();
  // Precondition: the group is complete, its bounds are not empty, the transform is not singular.
  void add_instance(std::uint32_t group, const Transform& to_world);
  void finish();

  // The hit of `ray` on a primitive Embree reported, by our own arithmetic: the bits follow from ray and
  // primitive alone.
  void triangle_hit(const Ray& ray, std::uint32_t triangle, SurfaceHit& hit) const;
  void sphere_hit(const Ray& ray, std::uint32_t sphere, SurfaceHit& hit) const;
  void disk_hit(const Ray& ray, std::uint32_t disk, SurfaceHit& hit) const;
  void cylinder_hit(const Ray& ray, std::uint32_t cylinder, SurfaceHit& hit) const;
  void hit(const Ray& ray, PrimitiveKind kind, std::uint32_t primitive, SurfaceHit& hit) const {
    if (kind == PrimitiveKind::triangle) [[likely]] {
      triangle_hit(ray, primitive, hit);
    } else {
      quadric_hit(ray, kind, primitive, hit);
    }
  }
  // The ray as an instance's group sees it: distances along it are those of the world.
  static Ray to_group(const Instance& instance, const Ray& ray);
  void instance_hit(const Ray& ray, std::uint32_t instance, PrimitiveKind kind, std::uint32_t primitive,
                    SurfaceHit& hit) const;

  // Both in the coordinates of the shape's group.
  Bounds bounds_of_shape(std::uint32_t shape) const;
  // False: the shape's surface has no point in the box.
  bool may_cross(std::uint32_t shape, const Bounds& box) const;
  // For points sampled on a triangle (quadrics.h has these for the others): texture coordinates (barycentric
  // ones where it has none), and the error bound of SurfaceHit.
  Vec2 uv_at(std::uint32_t triangle, float b1, float b2) const;
  float point_error(std::uint32_t triangle, Vec3 p) const;

 private:
  Bounds bounds_of_triangle(std::uint32_t triangle) const;
  void quadric_hit(const Ray& ray, PrimitiveKind kind, std::uint32_t primitive, SurfaceHit& hit) const;
  // All of a hit that the surface's parameterization does not say.
  [[gnu::always_inline]] const ShapeRecord& name_hit(std::uint32_t shape, std::uint32_t primitive,
                                                     SurfaceHit& hit) const {
    const ShapeRecord& record = shapes[shape];
    hit.primitive = primitive;
    hit.shape = shape;
    hit.bsdf = record.bsdf;
    hit.emitter = record.emitter;
    hit.medium_interface = record.medium_interface;
    return record;
  }
  [[gnu::noinline]] void triangle_partials(std::uint32_t triangle, SurfaceHit& hit) const;
};

}  // namespace candela::scene
