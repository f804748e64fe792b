// Surfaces of several shapes that lie in one plane, over each other. A ray meets them at one distance, and
// which of them Embree calls the nearest hangs on the last bits of its reciprocals, which begin with an
// estimate that differs between vendors of processors. So the choice is ours: the shape that comes first.
//
// Looked at are triangles and disks of the scene itself; not those of shapegroups, and not what one shape has
// twice.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "worker/core/vec.h"
#include "worker/scene/shapes/geometry.h"

struct RTCDeviceTy;

namespace candela::scene {

// The place of a shape in a plane: a box, and edges of the shape's outline, which cut off the corners of the
// box that the shape does not fill. Box and edges are padded, since a point at Embree's distance may be
// outside.
struct Place {
  struct Edge {
    Vec3 outward;
    float distance = 0;  // of the edge along it from the origin
  };
  static constexpr std::size_t kMaxEdges = 4;
  Vec3 low, high;
  std::array<Edge, kMaxEdges> edges;
  std::size_t edge_count = 0;

  bool holds(Vec3 p) const {
    if (!(p.x >= low.x && p.x <= high.x && p.y >= low.y && p.y <= high.y && p.z >= low.z && p.z <= high.z))
      return false;
    for (std::size_t i = 0; i < edge_count; ++i)
      if (dot(edges[i].outward, p) > edges[i].distance) return false;
    return true;
  }
};

// A triangle or disk that shares a part of its plane with another shape.
struct Contested {
  PrimitiveKind kind;
  std::uint32_t shape;
  std::uint32_t primitive;    // in Geometry's array of its kind
  std::uint32_t plane;        // the same for those that lie in one plane
  std::vector<Place> others;  // where the other shapes are, as far as they overlap it; a few
};
// Sorted by shape, kind and primitive. Two planes are one if their normals and distances differ by little
// more than float arithmetic makes of them. (As a rule: where these are rounded to two values, they are
// missed.) Primitives whose boxes overlap another shape's part of the plane count, whether or not they do
// themselves.
// `looked_at`: by shape, those that count; null: all.
std::vector<Contested> find_contested(const Geometry& geometry, const std::vector<bool>* looked_at = nullptr);

class Ties {
 public:
  // Null where nothing is contested. geometry: has to outlive this. Errors are the device's.
  static std::unique_ptr<Ties> build(RTCDeviceTy* device, const Geometry& geometry);
  Ties(const Ties&) = delete;
  Ties& operator=(const Ties&) = delete;
  ~Ties();

  // Replaces the primitive that Embree found by the first one that the ray meets at Embree's `distance`.
  void settle(const Ray& ray, float distance, PrimitiveKind& kind, std::uint32_t& primitive) const {
    if (primitive >= contested_end_[static_cast<std::size_t>(kind)]) return;
    const std::uint32_t index = index_[static_cast<std::size_t>(kind)][primitive];
    if (index != kNone) settle_contested(ray, distance, index, kind, primitive);
  }

 private:
  struct Scene;
  Ties();
  void settle_contested(const Ray& ray, float distance, std::uint32_t index, PrimitiveKind& kind,
                        std::uint32_t& primitive) const;

  std::vector<Contested> contested_;
  std::array<std::vector<std::uint32_t>, kPrimitiveKinds> index_;  // in contested_, or kNone
  // One past the last contested primitive of a kind.
  std::array<std::uint32_t, kPrimitiveKinds> contested_end_{};
  std::unique_ptr<Scene> scene_;
};

}  // namespace candela::scene
