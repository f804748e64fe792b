// Maps of directions against their definitions, in long double.
#include <gtest/gtest.h>

#include <cmath>

#include "common/rng/stream.h"
#include "worker/scene/edits/direction_map.h"

namespace candela::scene {
namespace {

using Long = TVec3<long double>;

double between(rng::Stream& stream, double low, double high) {
  return low + (high - low) * stream.next_double();
}
Vec3d direction(rng::Stream& stream) {
  for (;;) {
    const Vec3d v{between(stream, -1, 1), between(stream, -1, 1), between(stream, -1, 1)};
    if (const double l = length(v); l > 0.1 && l < 1) return v / l;
  }
}
edits::Triple triple(Vec3d v) {
  return {v.x, v.y, v.z};
}

edits::Edit random_move(rng::Stream& stream) {
  edits::Edit edit;
  edits::Move move;
  move.from = triple(direction(stream) * between(stream, 1, 3));
  move.to = triple(direction(stream) * between(stream, 1, 3));
  for (double& entry : move.linear) entry += between(stream, -0.4, 0.4);
  if (stream.next_double() < 0.7) move.normal = triple(direction(stream) * between(stream, 0.5, 2));
  edit.move = move;
  return edit;
}
edits::Edit random_rotation(rng::Stream& stream) {
  edits::Edit edit;
  edit.rotate = edits::Rotation{triple(direction(stream) * 2), between(stream, -180, 180)};
  return edit;
}

Long times(const std::array<double, 9>& m, Long v) {
  const auto row = [&](std::size_t i) {
    return static_cast<long double>(m[3 * i]) * v.x + static_cast<long double>(m[3 * i + 1]) * v.y +
           static_cast<long double>(m[3 * i + 2]) * v.z;
  };
  return {row(0), row(1), row(2)};
}
Long of(const edits::Triple& v) {
  return Long(Vec3d{v[0], v[1], v[2]});
}

// The direction to which the definition sends w: that of the plane point's image, or Rodrigues' rotation.
Long defined(const edits::Edit& edit, Long x, Long w) {
  if (edit.rotate) {
    const Long k = normalize(of(edit.rotate->axis));
    const long double a = static_cast<long double>(edit.rotate->degrees) * std::acos(-1.0L) / 180;
    return w * std::cos(a) + cross(k, w) * std::sin(a) + k * (dot(k, w) * (1 - std::cos(a)));
  }
  const Long d = of(edit.move->from) - x, m = edit.move->normal ? of(*edit.move->normal) : d;
  const long double t = dot(m, d) / dot(m, w);
  const Long image = of(edit.move->to) + times(edit.move->linear, w * t - d);
  return normalize((image - x) * (t < 0 ? -1.0L : 1.0L));
}

// Claim: M sends the direction to a point of the plane to that to its image, a rotation turns as Rodrigues
// says; R undoes it; J is the change of solid angle, by differences of the definition.
TEST(DirectionMaps, AreWhatTheyAreDefinedAs) {
  rng::Stream stream(rng::key(1));
  int regular = 0;
  for (int i = 0; i < 2000; ++i) {
    const edits::Edit edit = i % 4 == 0 ? random_rotation(stream) : random_move(stream);
    const DirectionMap map = direction_map(edit);
    const Vec3d x = direction(stream) * between(stream, 0, 1), w = direction(stream);
    MapAtVertex at;
    if (!at.set(map, x)) continue;
    const Vec3d o = at.forward(w);
    const Long expected = defined(edit, Long(x), Long(w));
    double jacobian = 0;
    const Vec3d back = at.backward(o, jacobian);
    // Near the plane through x the map magnifies rounding, by as much as it does differences.
    const double magnified = std::max(1.0, std::max(1 / jacobian, jacobian));
    if (magnified > 1e4) continue;
    ++regular;
    EXPECT_LT(static_cast<double>(length(expected - Long(o))), 1e-12 * magnified) << i;
    EXPECT_LT(length(back - w), 1e-12 * magnified) << i;
    // The area that a square of side h about w has after the map.
    const long double h = 1e-6L;
    const Long u = normalize(cross(Long(w), std::abs(w.x) < 0.5 ? Long{1, 0, 0} : Long{0, 1, 0})),
               v = cross(Long(w), u);
    const auto moved = [&](Long a) { return defined(edit, Long(x), normalize(Long(w) + a * h)); };
    const Long du = (moved(u) - moved(-u)) / (2 * h), dv = (moved(v) - moved(-v)) / (2 * h);
    const auto area = static_cast<double>(length(cross(du, dv)));
    EXPECT_NEAR(jacobian * area, 1, 1e-6 * magnified) << i;
  }
  EXPECT_GT(regular, 1500);
}

// Claim: J of a move and J of the move back multiply to 1.
TEST(DirectionMaps, JacobiansOfInversesCancel) {
  rng::Stream stream(rng::key(2));
  for (int i = 0; i < 500; ++i) {
    edits::Edit edit = random_move(stream);
    if (!edit.move->normal) edit.move->normal = triple(direction(stream));
    const DirectionMap map = direction_map(edit);
    edits::Edit back = edit;
    std::swap(back.move->from, back.move->to);
    for (std::size_t r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c)
        back.move->linear[3 * r + static_cast<std::size_t>(c)] = map.inverse.rows[r][c];
    // The normal of the plane's image.
    const Vec3d m = map.normal;
    Vec3d n;
    for (int r = 0; r < 3; ++r) n += map.inverse.rows[r] * m[r];
    back.move->normal = triple(n);
    const DirectionMap map_back = direction_map(back);
    const Vec3d x = direction(stream) * 0.5, o = direction(stream);
    MapAtVertex there, here;
    if (!there.set(map, x) || !here.set(map_back, x)) continue;
    double j = 0, j_back = 0;
    const Vec3d w = there.backward(o, j);
    static_cast<void>(here.backward(w, j_back));
    EXPECT_NEAR(j * j_back, 1, 1e-9 * std::max(j, 1 / j)) << i;
  }
}

// Claim: a vertex in the plane that moves, or in its image, has no map; elsewhere it has one.
TEST(DirectionMaps, AreSingularInTheirPlanes) {
  edits::Edit edit;
  edit.move = edits::Move{{2, 0, 0}, {0, 3, 0}, {1, 0, 0, 0, 1, 0, 0, 0, 1}, edits::Triple{0, 0, 1}};
  const DirectionMap map = direction_map(edit);
  MapAtVertex at;
  EXPECT_FALSE(at.set(map, {0, 0, 0}));
  EXPECT_FALSE(at.set(map, {5, 1, 1e-3}));
  EXPECT_TRUE(at.set(map, {0, 0, 1}));
  edit.move->to[2] = 5;  // the image's plane is another one
  const DirectionMap raised = direction_map(edit);
  EXPECT_FALSE(at.set(raised, {1, 1, 1e-4}));
  EXPECT_FALSE(at.set(raised, {1, 1, 5}));
  EXPECT_TRUE(at.set(raised, {1, 1, 1}));
  edit.move->normal.reset();
  const DirectionMap facing = direction_map(edit);
  EXPECT_FALSE(at.set(facing, {2, 0, 0}));
  EXPECT_TRUE(at.set(facing, {0, 0, 0.1}));
}

// Claim: the cone of a region is the directions whose rays pass through it: those of points inside are in it,
// and rays whose every point is outside are not.
TEST(Cones, AreRaysThroughRegions) {
  rng::Stream stream(rng::key(3));
  int met = 0, missed = 0;
  for (int i = 0; i < 2000; ++i) {
    Cone cone;
    cone.everywhere = false;
    cone.sphere = i % 2 == 0;
    cone.low = direction(stream) * between(stream, 0, 2);
    cone.high = cone.low + Vec3d{between(stream, 0.1, 1), between(stream, 0.1, 1), between(stream, 0.1, 1)};
    cone.radius = between(stream, 0.1, 1);
    const Vec3d x = direction(stream) * between(stream, 0, 2);
    Vec3d inside = cone.low + Vec3d{between(stream, 0, 1) * (cone.high.x - cone.low.x),
                                    between(stream, 0, 1) * (cone.high.y - cone.low.y),
                                    between(stream, 0, 1) * (cone.high.z - cone.low.z)};
    if (cone.sphere) inside = cone.low + direction(stream) * (cone.radius * 0.999);
    EXPECT_TRUE(encloses(cone, inside));
    EXPECT_TRUE(contains(cone, x, normalize(inside - x)));
    const Vec3d w = direction(stream);
    bool any = false, near = false;
    for (int k = 0; k < 600; ++k) {
      const Vec3d p = x + w * (k * 0.01);
      any |= encloses(cone, p);
      Cone wider = cone;
      wider.radius += 0.01;
      wider.low = cone.sphere ? cone.low : cone.low - Vec3d{0.01, 0.01, 0.01};
      wider.high = cone.high + Vec3d{0.01, 0.01, 0.01};
      near |= encloses(wider, p);
    }
    if (any == near) {
      EXPECT_EQ(contains(cone, x, w), any) << i;
      (any ? met : missed) += 1;
    }
  }
  EXPECT_GT(met, 100);
  EXPECT_GT(missed, 100);
}

}  // namespace
}  // namespace candela::scene
