// Scenes whose light no technique of bidirectional path tracing can sample, of the theory of regularization.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <string>

#include "worker/core/vec.h"

namespace candela::test {

inline std::string point(Vec3d p) {
  return fmt::format("{:.17g}, {:.17g}, {:.17g}", p.x, p.y, p.z);
}
// A square around p whose front looks along n.
inline std::string square(Vec3d p, Vec3d n, double half, const std::string& bsdf) {
  const Vec3d up = std::abs(n.z) < 0.9 ? Vec3d(0, 0, 1) : Vec3d(0, 1, 0);
  return fmt::format(
      "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"{}\"/><lookat origin=\"{}\" "
      "target=\"{}\" up=\"{}\"/></transform>{}</shape>",
      half, point(p), point(p + n), point(up), bsdf);
}
inline const std::string kMirror =
    R"(<bsdf type="twosided"><bsdf type="conductor"><string name="material" value="none"/></bsdf></bsdf>)";

inline std::string camera(Vec3d from, Vec3d direction, double fov, double near_clip = 0.001) {
  const Vec3d up = std::abs(direction.z) < 0.9 ? Vec3d(0, 0, 1) : Vec3d(0, 1, 0);
  return fmt::format(
      "<sensor type=\"perspective\"><float name=\"fov\" value=\"{}\"/><float name=\"near_clip\" "
      "value=\"{}\"/><float name=\"far_clip\" value=\"{}\"/><transform name=\"to_world\"><lookat "
      "origin=\"{}\" target=\"{}\" "
      "up=\"{}\"/></transform></sensor>",
      fov, near_clip, 1e7 * near_clip, point(from), point(from + direction), point(up));
}

inline Vec3d mirrored(Vec3d p, Vec3d q, Vec3d n) {
  return p - n * (2 * dot(p - q, n));
}
// Point where the ray from o along d meets the plane through p.
inline Vec3d on_plane(Vec3d o, Vec3d d, Vec3d p, Vec3d n) {
  return o + d * (dot(p - o, n) / dot(d, n));
}
inline double angle(Vec3d a, Vec3d b) {
  return std::acos(dot(normalize(a), normalize(b))) * 180 / std::numbers::pi;
}

// A scene's XML, in parts.
struct SceneText {
  std::string sensor, body;
};

// Scene T: two tilted mirrors, no matt surface. The lamp's image at the distance D sends I / D^2 to the lens,
// over all directions; the film shows it as a blurred disc.
struct SceneT {
  static constexpr double kD = 3.4, kBeforeB = 0.8, kBeforeA = 1.0, kIntensity = 5;
};
// The scene of this size, moved: the lamp's intensity grows with the square of the size, so that pictures do
// not change. before_b: the length of the edge between the lamp and mirror B.
inline SceneText scene_t(double fov, double size = 1, Vec3d moved = {}, double before_b = SceneT::kBeforeB) {
  const Vec3d na = normalize(Vec3d(0.3, 0, 1)), nb = normalize(Vec3d(-0.4, 0.2, 1));
  // The light's path unfolds to the z axis: first the direction behind A, then that behind B.
  const Vec3d first = mirrored(Vec3d(0, 0, 1), {}, na), second = mirrored(first, {}, nb);
  const Vec3d eye = moved, a = moved + Vec3d(0, 0, size), b = a + first * (1.6 * size),
              lamp = b + second * (before_b * size);
  return {camera(eye, {0, 0, 1}, fov, 0.001 * size),
          square(a, -na, 0.7 * size, kMirror) + square(b, nb, 0.7 * size, kMirror) +
              fmt::format("<emitter type=\"spot\"><rgb name=\"intensity\" value=\"{}\"/><float "
                          "name=\"cutoff_angle\" value=\"30\"/><float name=\"beam_width\" "
                          "value=\"29.5\"/><transform name=\"to_world\"><lookat origin=\"{}\" "
                          "target=\"{}\" up=\"0.1,0.2,1\"/></transform></emitter>",
                          SceneT::kIntensity * size * size, point(lamp), point(b))};
}

}  // namespace candela::test
