// Scenes of one emitter each, for the tests of emitters: every kind, with what is known of it on paper.
#pragma once

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "tests/statistical/moments.h"
#include "tests/unit/scene_fixture.h"

namespace candela::test {

using Mean = statistical::Moments;

struct Draws {
  rng::Stream stream;
  Draws(std::uint64_t test, std::uint64_t seed) : stream(rng::key(test, seed)) {}
  float next() { return stream.next_float(); }
  Vec2 next_2d() {
    const float x = stream.next_float();
    return {x, stream.next_float()};
  }
};

inline bool draw_emission(const scene::Scene& scene, Draws& draws, scene::EmissionSample& out) {
  const float u = draws.next();
  const Vec2 position = draws.next_2d();
  return scene.sample_emission(u, position, draws.next_2d(), out);
}

// All lie around (0, 0, 2), within 0.9 of it, and light the origin; a floor at z = 0, if any, faces them.
struct LightCase {
  std::string name, body;
  double area = 0;   // of an emitting surface, m^2
  double power = 0;  // W in green; < 0: depends on the scene's extent (light from outside), W / m^2 of the
                     // bounding sphere's disk
  double power_error = 0;  // relative, of the code's quadrature where a texture is projected
};

inline std::string small_map() {
  // 8 x 4 pixels, PFM: rows from the bottom, little endian floats; a bright spot and a gradient.
  std::string text = "PF\n8 4\n-1.0\n";
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 8; ++x) {
      for (int c = 0; c < 3; ++c) {
        const float v = 0.2f + 0.1f * static_cast<float>(x + y) + (x == 2 && y == 2 ? 5.0f : 0.0f);
        char bytes[4];
        __builtin_memcpy(bytes, &v, 4);
        text.append(bytes, 4);
      }
    }
  }
  return text;
}
inline std::map<std::string, std::string> light_files() {
  return {{"map.pfm", small_map()}};
}

inline const std::vector<LightCase>& light_cases() {
  constexpr double pi = std::numbers::pi;
  const std::string one = "<emitter type=\"area\"/></shape>";
  const std::string two = "<emitter type=\"area\"><rgb name=\"radiance\" value=\"2\"/></emitter></shape>";
  const std::string checker =
      "<emitter type=\"area\"><texture name=\"radiance\" type=\"checkerboard\"><rgb name=\"color0\" "
      "value=\"0.2\"/><rgb name=\"color1\" value=\"1\"/><transform name=\"to_uv\"><scale x=\"2\" "
      "y=\"2\"/></transform></texture></emitter></shape>";
  const std::string facing_down = matrix({0.5, 0, 0, 0.1, 0, -0.4, 0, 0.1, 0, 0, -1, 2, 0, 0, 0, 1});
  const std::string sheared = matrix({0.5, 0.3, 0, 0.1, 0, -0.4, 0, 0.1, 0, 0, -1, 2, 0, 0, 0, 1});
  const std::string tilted =  // a rotation of a cube of side 1
      matrix({0.4, 0, 0.3, 0, 0, 0.5, 0, 0.1, 0.3, 0, -0.4, 2, 0, 0, 0, 1});
  const std::string ball =
      "<point name=\"center\" x=\"0.1\" y=\"0\" z=\"2\"/><float name=\"radius\" value=\"0.5\"/>";
  const std::string tube =
      "<point name=\"p0\" x=\"-0.6\" y=\"0.1\" z=\"2\"/><point name=\"p1\" x=\"0.5\" y=\"0\" z=\"2.3\"/>"
      "<float name=\"radius\" value=\"0.3\"/>";
  const double tube_area = 2 * pi * 0.3 * std::sqrt(1.1 * 1.1 + 0.1 * 0.1 + 0.3 * 0.3);
  const double c = 40 * pi / 180, b = 25 * pi / 180;
  const std::string aim =
      "<transform name=\"to_world\"><lookat origin=\"0.2,0.1,2\" target=\"0.3,0,0\" up=\"0,1,0\"/>"
      "</transform>";
  static const std::vector<LightCase> cases = {
      {"rectangle", "<shape type=\"rectangle\">" + facing_down + two, 0.8, 2 * 0.8 * pi},
      {"sheared rectangle", "<shape type=\"rectangle\">" + sheared + one, 0.8, 0.8 * pi},
      {"textured rectangle", "<shape type=\"rectangle\">" + facing_down + checker, 0.8, 0.6 * 0.8 * pi},
      {"sphere", "<shape type=\"sphere\">" + ball + two, pi, 2 * pi * pi},
      {"textured sphere", "<shape type=\"sphere\">" + ball + checker, pi, 0.6 * pi * pi},
      {"inner sphere",
       "<shape type=\"sphere\">" + ball + "<boolean name=\"flip_normals\" value=\"true\"/>" + two, pi,
       2 * pi * pi},
      {"disk",
       "<shape type=\"disk\">" + matrix({0.5, 0, 0, 0.1, 0, -0.5, 0, 0.1, 0, 0, -0.5, 2, 0, 0, 0, 1}) + two,
       pi / 4, pi * pi / 2},
      {"textured disk",
       "<shape type=\"disk\">" + matrix({0.5, 0, 0, 0.1, 0, -0.5, 0, 0.1, 0, 0, -0.5, 2, 0, 0, 0, 1}) +
           checker,
       pi / 4, 0.6 * pi * pi / 4},
      {"cylinder", "<shape type=\"cylinder\">" + tube + one, tube_area, tube_area * pi},
      {"textured cylinder", "<shape type=\"cylinder\">" + tube + checker, tube_area, 0.6 * tube_area * pi},
      {"inner cylinder",
       "<shape type=\"cylinder\">" + tube + "<boolean name=\"flip_normals\" value=\"true\"/>" + one,
       tube_area, tube_area * pi},
      {"cube", "<shape type=\"cube\">" + tilted + one, 6, 6 * pi},
      {"point",
       "<emitter type=\"point\"><point name=\"position\" x=\"0.2\" y=\"0.1\" z=\"2\"/><rgb "
       "name=\"intensity\" value=\"3\"/></emitter>",
       0, 3 * 4 * pi},
      {"spot",
       "<emitter type=\"spot\">" + aim +
           "<rgb name=\"intensity\" value=\"3\"/><float name=\"cutoff_angle\" value=\"40\"/><float "
           "name=\"beam_width\" value=\"25\"/></emitter>",
       0, 3 * 2 * pi * (1 - (std::sin(c) - std::sin(b)) / (c - b))},
      {"sharp spot",
       "<emitter type=\"spot\">" + aim +
           "<float name=\"cutoff_angle\" value=\"25\"/><float name=\"beam_width\" value=\"25\"/></emitter>",
       0, 2 * pi * (1 - std::cos(b))},
      {"wide spot",
       "<emitter type=\"spot\">" + aim +
           "<float name=\"cutoff_angle\" value=\"140\"/><float name=\"beam_width\" value=\"0\"/></emitter>",
       0, 2 * pi * (1 - std::sin(140 * pi / 180) / (140 * pi / 180))},
      {"textured spot",
       "<emitter type=\"spot\">" + aim +
           "<float name=\"cutoff_angle\" value=\"25\"/><float name=\"beam_width\" value=\"25\"/>"
           "<texture name=\"texture\" type=\"checkerboard\"><rgb name=\"color0\" value=\"0.2\"/><rgb "
           "name=\"color1\" value=\"1\"/></texture></emitter>",
       0, 0.6 * 2 * pi * (1 - std::cos(b)), 2e-2},
      {"directional",
       "<emitter type=\"directional\"><vector name=\"direction\" x=\"0.3\" y=\"-0.2\" z=\"-2\"/><rgb "
       "name=\"irradiance\" value=\"3\"/></emitter>",
       0, -3},
      {"constant", "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"3\"/></emitter>", 0,
       -3 * 4 * pi},
      {"envmap",
       "<emitter type=\"envmap\"><string name=\"filename\" value=\"map.pfm\"/><float name=\"scale\" "
       "value=\"2\"/><transform name=\"to_world\"><rotate x=\"1\" angle=\"70\"/></transform></emitter>",
       0, 0},
      {"projector",
       "<emitter type=\"projector\">" + aim +
           "<float name=\"fov\" value=\"60\"/><float name=\"scale\" value=\"3\"/><texture "
           "name=\"irradiance\" "
           "type=\"checkerboard\"><rgb name=\"color0\" value=\"0.2\"/><rgb name=\"color1\" "
           "value=\"1\"/></texture>"
           "</emitter>",
       0, 3 * 0.6 * pi * 4 / 3},
      {"projected intensity",
       "<emitter type=\"projector\">" + aim +
           "<float name=\"fov\" value=\"60\"/><float name=\"scale\" value=\"3\"/><string "
           "name=\"quantity\" value=\"intensity\"/></emitter>",
       0, 3 * 4 * std::asin(0.25), 2e-4},
  };
  return cases;
}

}  // namespace candela::test
