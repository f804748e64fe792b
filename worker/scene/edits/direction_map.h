// Maps of directions by which edits turn light at a vertex x [docs/edits.md]: linear maps B(x) of R^3, as
// maps of unit directions, their inverses, and the change of solid angle.
//
//   M(w) = B w / |B w|     R(o) = B^-1 o / |B^-1 o|     J(o) = |d omega(R o) / d omega(o)| = 1 / (|det B|
//   |B^-1 o|^3)
//
// A rotation Q has B = Q. A move y -> to + L (y - from) of the points y of the plane through `from` with
// normal m has
//   B = L + (e - L d) m^T / (m.d),   d = from - x, e = to - x,
// so that the direction to a point of the plane becomes the direction to its image. The matrix determinant
// lemma gives det B = det L (m.L^-1 e) / (m.d), and Sherman and Morrison the inverse.
#pragma once

#include "common/edits/edits.h"
#include "worker/core/vec.h"

namespace candela::scene {

struct Matrix3 {
  Vec3d rows[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  Vec3d operator*(Vec3d v) const { return {dot(rows[0], v), dot(rows[1], v), dot(rows[2], v)}; }
  double determinant() const { return dot(rows[0], cross(rows[1], rows[2])); }
  Matrix3 inverse() const;
};

// The map of an edit, wherever its vertex is. Places are those of the scene's file.
struct DirectionMap {
  Matrix3 linear, inverse;
  double determinant = 1;
  bool turns = false;  // it is not the identity
  bool moves = false;  // a move, else a linear map of directions
  bool facing = true;  // m = d
  Vec3d from, to, normal;
};
DirectionMap direction_map(const edits::Edit& edit);

// Below these cosines of m with d, and with L^-1 e, a map is singular: its vertex lies in the plane that
// moves, or that is moved to, and the edit does nothing there.
inline constexpr double kSingularCosine = 1e-3;

// The map at one vertex.
class MapAtVertex {
 public:
  // False: singular there.
  bool set(const DirectionMap& map, Vec3d x);
  // w and the result are unit.
  Vec3d forward(Vec3d w) const;
  // R(o), and J(o).
  Vec3d backward(Vec3d o, double& jacobian) const;

 private:
  const DirectionMap* map_ = nullptr;
  Vec3d m_, add_, add_back_;  // B = L + add m^T; B^-1 v = L^-1 v - add_back (m.L^-1 v)
  double determinant_ = 1;
};

// A region that rays may meet.
struct Cone {
  bool everywhere = true;  // all directions
  bool sphere = false;
  Vec3d low, high;  // a sphere has its center in low
  double radius = 0;
};
Cone cone_of(const edits::EditList& list, const edits::Edit& edit);
Cone cone_of(const letters::Region& region);
// The ray from x along w (unit) meets it.
bool contains(const Cone& cone, Vec3d x, Vec3d w);
bool encloses(const Cone& cone, Vec3d p);

}  // namespace candela::scene
