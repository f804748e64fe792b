// The primitives of a small scene, eight at a time, without a tree; or the round ones of a scene that has few
// of them beside its meshes. Up to a few dozen this takes less time than Embree, and the same bits follow on
// every processor.
//
// A ray meets a triangle if it passes the three edges on one side. In float, and in coordinates in which the
// triangle has the corners (0, 0), (1, 0) and (0, 1) of the plane z = 0, the sides are known but for rays
// that come close to an edge; bounds of the rounding errors say which. Those are decided by signs of volumes
// in double. Two triangles compute the same volume at a common edge, so no ray passes between them. (Embree's
// robust kernels do that in float, for all rays [Wald 2014].)
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "worker/core/vec.h"
#include "worker/scene/shapes/geometry.h"

namespace candela::scene {

class FewPrimitives {
 public:
  // Takes the scene itself, without its instances. Null if the scene has many round primitives, or none and
  // many triangles. geometry: has to outlive this.
  static std::unique_ptr<FewPrimitives> build(const Geometry& geometry);

  // True: all that a ray can meet. False: the round primitives alone; others are the tree's.
  bool whole() const { return whole_; }

  // False: a ray of this length meets none of the round primitives, which lie together in a ball. Most rays
  // in a scene of meshes pass it by.
  bool may_meet_round(const Ray& ray, float length) const {
    const Vec3 o = ray.origin, d = ray.direction, from = o - middle_;
    // Errors are bounded as in for_each_met().
    const float size = std::max({std::abs(o.x), std::abs(o.y), std::abs(o.z)}) * 3 + extent_;
    const float limit = reach_ * reach_ + size * size * kSquareError;
    if (length_squared(from) <= limit) return true;
    const float away = dot(from, d);
    return away <= 0 && length_squared(from - d * away) <= limit &&
           -away <= length * (1 + 0x1p-20f) + (reach_ + size * kSquareError);
  }

  // The nearest primitive in [0, ray.t_max), and its distance; of several at one distance the first.
  // Precondition: the ray is finite, its direction unit.
  bool intersect(const Ray& ray, float& distance, PrimitiveKind& kind, std::uint32_t& primitive) const;
  bool occluded(const Ray& ray) const;
  // A lower bound, at most `limit`, of the distance from p to what it takes; wrong by a few roundings of
  // coordinates. Not tight before edges of triangles, and around disks and cylinders.
  float clearance(Vec3 p, float limit) const;

 private:
  static constexpr std::size_t kWidth = 8;
  // Bounds the errors of squared distances in float, as a part of the square of the largest coordinates' sum.
  static constexpr float kSquareError = 0x1p-18f;
  using Lanes = std::array<float, kWidth>;
  // Eight triangles. The point p has the coordinates rows[k] . p + shift[k]. A volume is wrong by at most
  // error_constant + error_slope |origin|, of the largest coordinate; so is a height over the plane.
  // Lanes without a triangle hold no number: no comparison holds there.
  struct alignas(32) Block {
    std::array<std::array<Lanes, 3>, 3> rows;
    std::array<Lanes, 3> shift;
    Lanes error_slope, error_constant;
    std::array<Lanes, 3> middle;  // with `reach`: a ball around the triangle
    Lanes reach;
  };
  // Eight balls around round primitives. Lanes without one have no radius.
  struct alignas(32) Balls {
    std::array<Lanes, 3> center;
    Lanes radius, radius_squared;
    Lanes extent;  // the radius and the magnitudes of the center's coordinates
    Lanes hollow;  // how close to the surface a place inside is at most: a sphere's radius; none: no number
  };
  struct Round {
    PrimitiveKind kind;
    std::uint32_t primitive;
  };
  // In double. The normal is the cross product of two edges.
  struct Exact {
    Vec3d corner, normal;
  };

  void surround();
  void add_round(PrimitiveKind kind, std::uint32_t primitive, const Vec3d& center, double radius);
  bool meets_round(const Round& round, const Vec3d& origin, const Vec3d& direction, double end,
                   double& t) const;

  explicit FewPrimitives(const Geometry& geometry) : geometry_(geometry) {}
  // False: many, or one too thin for bounds of the rounding errors.
  bool take_triangles(std::size_t count);
  // False: the triangle is too thin.
  static bool set_lane(const std::array<Vec3, 3>& corners, std::size_t lane, Block& block);
  // Calls met(kind, primitive, distance) for primitives that the ray meets, at least for all in [0, end],
  // until it returns true. met may lower `end`.
  template <class Met>
  bool for_each_met(const Ray& ray, const double& end, const Met& met) const;
  bool passes_inside(const Vec3d& origin, const Vec3d& direction, std::uint32_t triangle) const;

  const Geometry& geometry_;
  bool whole_ = false;
  std::vector<Block> blocks_;
  std::vector<Exact> exact_;  // by triangle
  std::vector<Balls> balls_;
  std::vector<Round> round_;  // by ball
  // The ball around all of `balls_`; extent as theirs.
  Vec3 middle_;
  float reach_ = 0, extent_ = 0;
};

}  // namespace candela::scene
