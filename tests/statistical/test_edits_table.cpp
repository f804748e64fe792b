// The rows of the table of the retargeting note (section 9), and of its table of a selection by the path
// (section 7), through the renderer: integrals over the floor of a panel's light, against quadrature to 1e-4.
// The floor is seen from above; its radiance is that for the note's eye, too, but if it is glossy: then it is
// seen from there. An integral over three Gaussians and 1 is a sum over pixels with the Gaussians' means over
// each (from the eye: with its values at the floor's places), which is right to 1e-3. With 24 batches a value
// is 5.5 standard errors off with probability 1.4e-5; there are fewer than 250 values: the file alarms
// falsely with probability below 4e-3.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "common/image/image.h"
#include "tests/proofs/proofs.h"
#include "tests/statistical/harness.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"EditTable"});

constexpr std::uint32_t kPixels = 64;

std::string matt(double reflectance) {
  return fmt::format(R"(<bsdf type="diffuse"><rgb name="reflectance" value="{}"/></bsdf>)", reflectance);
}
std::string phong(double diffuse, double specular, int exponent) {
  return fmt::format(
      R"(<bsdf type="phong"><float name="exponent" value="{}"/><rgb name="specular_reflectance" value="{}"/>
        <rgb name="diffuse_reflectance" value="{}"/></bsdf>)",
      exponent, specular, diffuse);
}

std::string mirror(double reflectance) {
  return fmt::format(
      R"(<bsdf type="conductor"><string name="material" value="none"/><rgb name="specular_reflectance" value="{}"/></bsdf>)",
      reflectance);
}

// Radiance of a lamp, exp(-r^2 / 0.5), r from the middle: the ceiling's, with (2, 1.6, 3), on 0.5 < x, y <
// 3.5; and the one behind the panel of glass, with (-1, 1.6, 1.95), on 0 < y < 3.5, 0.3 < z < 3.3.
constexpr std::uint32_t kTexels = 192;
std::string lamp_picture(bool behind) {
  std::vector<float> rgb;
  for (std::uint32_t row = 0; row < kTexels; ++row)
    for (std::uint32_t column = 0; column < kTexels; ++column) {
      const double u = (column + 0.5) / kTexels, v = (row + 0.5) / kTexels;
      const double a = behind ? 3.3 - 3 * u - 1.95 : 0.5 + 3 * u - 2,
                   b = behind ? 3.5 * v - 1.6 : 3.5 - 3 * v - 1.6;
      rgb.insert(rgb.end(), 3, static_cast<float>(std::exp(-(a * a + b * b) / 0.5)));
    }
  const auto exr = image::encode_exr(kTexels, kTexels, rgb, {});
  if (!exr.ok()) throw std::runtime_error(exr.error().to_string());
  return *exr;
}

struct Room {
  std::string panel = phong(0.2, 0.6, 20), floor = matt(0.7);
  bool ceiling = false;   // lights it, in place of a point
  bool from_eye = false;  // it is seen from the note's eye
  // All that is behind the panel is glass, and a lamp in it lights the floor through the panel.
  bool glass = false;
  std::uint32_t pixels() const;
};
constexpr std::array<double, 3> kEye = {3.6, 0.4, 2.5};
constexpr double kFromEyeAngle = 125;  // with all of the floor in view
constexpr std::uint32_t kFromEyePixels = 192;

std::uint32_t Room::pixels() const {
  return from_eye ? kFromEyePixels : kPixels;
}

std::string room_text(const Room& room) {
  const std::string place =
      room.glass
          ? R"(<scale x="1.5" y="1.75"/><rotate y="1" angle="90"/><translate x="-1" y="1.75" z="1.8"/>)"
          : R"(<scale value="1.5"/><rotate x="1" angle="180"/><translate x="2" y="2" z="3"/>)";
  const std::string lamp =
      room.ceiling || room.glass
          ? R"(<shape type="rectangle"><transform name="to_world">)" + place +
                R"(</transform><bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
      <emitter type="area"><texture type="bitmap" name="radiance"><string name="filename" value="lamp.exr"/>
        <boolean name="raw" value="true"/></texture></emitter></shape>)"
          : R"(<emitter type="point"><point name="position" x="2.6" y="1.2" z="2.4"/><rgb name="intensity" value="1"/></emitter>)";
  const std::string sensor =
      room.from_eye
          ? fmt::format(
                R"(<sensor type="perspective"><float name="fov" value="{}"/><transform name="to_world">
      <lookat origin="{}, {}, {}" target="1.9, 2, 0" up="0, 0, 1"/></transform></sensor>)",
                kFromEyeAngle, kEye[0], kEye[1], kEye[2])
          : R"(<sensor type="orthographic"><transform name="to_world"><scale x="2" y="2"/>
      <lookat origin="2, 2, 2.9" target="2, 2, 0" up="0, 1, 0"/></transform></sensor>)";
  return R"(<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="3"/></integrator>)" +
         sensor + lamp +
         R"(<shape type="rectangle" id="floor"><transform name="to_world"><scale value="2"/><translate x="2" y="2"/></transform>)" +
         room.floor +
         R"(</shape><shape type="rectangle" id="panel"><transform name="to_world"><scale x="1" y="2"/><rotate y="1" angle="90"/>
      <translate y="2" z="1.8"/></transform>)" +
         room.panel + "</shape></scene>";
}

TestScene scene_of(const Room& room) {
  TestScene scene;
  scene.files = std::make_shared<MemorySource>(std::map<std::string, std::string>{
      {"scene.xml", room_text(room)}, {"lamp.exr", lamp_picture(room.glass)}});
  scene.main_key = "scene.xml";
  return read_scene(std::move(scene), room.pixels(), room.pixels());
}

using Measures = std::array<double, 4>;

struct Row {
  std::string name, edits;
  int edges;  // of the longest path; paths of two edges, straight from the lamp, do not count
  Measures reference;
  Room room = {};
  friend void PrintTo(const Row& row, std::ostream* out) { *out << row.name; }
};

// A lobe of exponent 20 has roughness 0.3015.
std::string list_of(const std::string& edits) {
  return R"({"glossy_below": 0.5, "regions": {"near": {"sphere": [2.2, 1.3, 0, 0.8]}, "next": {"sphere": [2, 1.8, 0, 0.9]},
      "bled": {"sphere": [1, 1, 0, 0.7]}, "wall": {"sphere": [0, 1.2, 1.6, 0.7]}, "image": {"sphere": [2.2, 1.6, 0, 0.6]},
      "seen": {"sphere": [1.2, 1.6, 0, 0.5]}},
    "edits": [)" +
         edits + "]}";
}
std::string edit(const std::string& name, const std::string& select, const std::string& rest) {
  return fmt::format(R"({{"name": "{}", "direction": "light", "select": "{}", {}}})", name, select, rest);
}

const std::string kRotation = R"("rotate": {"axis": [0, 0.6, 0.8], "degrees": 20})";
std::string moved(const std::string& to, const std::string& from = "[2.2, 1.3, 0]") {
  return R"("move": {"from": )" + from + R"(, "to": )" + to +
         R"(, "normal": [0, 0, 1], "linear": [1.299038106, -0.35, 0, 0.75, 0.606217783, 0, 0, 0, 1]})";
}
const std::vector<Row>& rows() {
  static const std::string highlight = R"("source": "near", )" + moved("[1.6, 2.4, 0]");
  static const std::vector<Row> all = {
      {"rotation",
       edit("a", "LX*X{panel}", kRotation),
       3,
       {0.0028965866, 0.0033564394, 0.0023028783, 0.037283463}},
      {"affine",
       edit("a", "LX*X{panel}", moved("[1.6, 2.8, 0]")),
       3,
       {0.00085401718, 0.001994642, 0.001509128, 0.018900602}},
      {"highlight",
       edit("a", "LX*G{panel}", highlight),
       3,
       {0.00065296837, 0.0029109552, 0.0023764961, 0.022649813}},
      {"sequence",
       edit("a", "LX*X{panel}", R"("source": "near", "rotate": {"axis": [0, 1, 0], "degrees": 12})") + "," +
           edit("b", "LX*X{panel}",
                R"("source": "next", "move": {"from": [2, 1.8, 0], "to": [1.4, 2.6, 0], "normal": [0, 0, 1],
                  "stretch": [0.6, 1.2, 1]})"),
       3,
       {0.00048719491, 0.0034786367, 0.00083593952, 0.023925778}},
      {"bleeding",
       edit("a", "LX*X{panel}",
            R"("source": "bled", "move": {"from": [1, 1, 0], "to": [2.4, 2.2, 0], "stretch": [2, 1, 1]})"),
       3,
       {0.0011027028, 0.0017497899, 0.0016452554, 0.01575672},
       {.panel = matt(0.6), .ceiling = true}},
      {"gather",
       R"({"name": "a", "direction": "eye", "select": "X{floor}X*E", "source": "wall",
         "move": {"from": [0, 1.2, 1.6], "to": [0, 2, 1.9], "normal": [1, 0, 0]}})",
       3,
       {0.0024408834, 0.0019779832, 0.0011056474, 0.025249387},
       {.floor = phong(0.3, 0.5, 12), .ceiling = true, .from_eye = true}},
      {"hit",
       edit(
           "a", "LX*X{panel}",
           R"("source": "bled", "hit": true, "move": {"from": [1, 1, 0], "to": [2.4, 2.2, 0], "normal": [0, 0, 1],
                "stretch": [2, 1, 1]})"),
       3,
       {0.0013175941, 0.0018095657, 0.001620311, 0.016287988},
       {.panel = matt(0.6), .ceiling = true}},
      {"mirror_rotation",
       edit("a", "LX*X{panel}", R"("rotate": {"axis": [0, 0.6, 0.8], "degrees": 12})"),
       3,
       {0.0041390281, 0.0057409598, 0.0030058186, 0.064016313},
       {.panel = mirror(0.9), .ceiling = true}},
      {"mirror_region",
       edit("a", "LX*X{panel}", R"("source": "image", )" + moved("[1.6, 2.2, 0]", "[2.2, 1.6, 0]")),
       3,
       {0.0014345931, 0.0064652454, 0.0040721186, 0.053874208},
       {.panel = mirror(0.9), .ceiling = true}},
      // The light that the panel reflects stays in the glass.
      {"glass_region",
       edit("a", "LX*S{panel}",
            R"("source": "seen", "move": {"from": [1.2, 1.6, 0], "to": [1.6, 2, 0], "normal": [0, 0, 1],
                "stretch": [1.6, 0.8, 1]})"),
       3,
       {0.0051773789, 0.0069167762, 0.0047931502, 0.076665841},
       {.panel =
            R"(<bsdf type="dielectric"><float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/></bsdf>)",
        .glass = true}},
      // Where the light came by the floor first.
      {"prefix_rotation",
       edit("a", "LX{floor}X{panel}", kRotation),
       4,
       {0.0021810249, 0.0020078611, 0.0017096011, 0.02396787}},
      {"prefix_highlight",
       edit("a", "LX{floor}X{panel}", highlight),
       4,
       {0.002115643, 0.0020244987, 0.0017228335, 0.023664008}},
  };
  return all;
}

// Integral over [a, b] of a Gaussian of width 0.4 around c.
double gaussian(double a, double b, double c) {
  constexpr double kWidth = 0.4;
  const auto at = [&](double x) { return std::erf((x - c) / (kWidth * std::sqrt(2.0))); };
  return kWidth * std::sqrt(std::acos(-1.0) / 2) * (at(b) - at(a));
}
constexpr std::array<std::array<double, 2>, 3> kCenters = {{{2.2, 1.3}, {1.6, 2.8}, {2.6, 2.6}}};

// The weight of each pixel in each integral over the floor.
using Weights = std::vector<Measures>;
Weights weights_from_above() {
  Weights weights;
  constexpr double kSide = 4.0 / kPixels;
  for (std::uint32_t row = 0; row < kPixels; ++row)
    for (std::uint32_t column = 0; column < kPixels; ++column) {
      const double x = column * kSide, y = 4 - (row + 1) * kSide;
      Measures& w = weights.emplace_back();
      for (std::size_t j = 0; j < 3; ++j)
        w[j] = gaussian(x, x + kSide, kCenters[j][0]) * gaussian(y, y + kSide, kCenters[j][1]);
      w[3] = kSide * kSide;
    }
  return weights;
}
// From the eye: by the places of a grid in each pixel, with the floor's area that each of them sees.
Weights weights_from_eye() {
  using V = std::array<double, 3>;
  const auto cross = [](V a, V b) {
    return V{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  };
  const auto unit = [](V a) {
    const double l = std::sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
    return V{a[0] / l, a[1] / l, a[2] / l};
  };
  const V forward = unit({1.9 - kEye[0], 2 - kEye[1], -kEye[2]}), right = unit(cross(forward, {0, 0, 1})),
          up = cross(right, forward);
  const double half = std::tan(kFromEyeAngle / 2 * std::acos(-1.0) / 180);
  constexpr std::uint32_t kGrid = 8;
  Weights weights;
  for (std::uint32_t row = 0; row < kFromEyePixels; ++row)
    for (std::uint32_t column = 0; column < kFromEyePixels; ++column) {
      Measures w{};
      bool sees_floor = false;
      for (std::uint32_t i = 0; i < kGrid * kGrid; ++i) {
        const double a = half * (2 * (column + (i % kGrid + 0.5) / kGrid) / kFromEyePixels - 1),
                     b = half * (1 - 2 * (row + (i / kGrid + 0.5) / kGrid) / kFromEyePixels);
        V d;
        for (std::size_t k = 0; k < 3; ++k) d[k] = forward[k] + a * right[k] + b * up[k];
        if (!(d[2] < 0)) continue;
        const double t = kEye[2] / -d[2], x = kEye[0] + t * d[0], y = kEye[1] + t * d[1];
        sees_floor |= x >= 0 && x <= 4 && y >= 0 && y <= 4;
        // The floor's area of a piece of the plane at distance 1 along `forward`: t^3 / height.
        const double side = 2 * half / kFromEyePixels / kGrid, area = side * side * t * t * t / kEye[2];
        for (std::size_t j = 0; j < 3; ++j) {
          const double r2 =
              (x - kCenters[j][0]) * (x - kCenters[j][0]) + (y - kCenters[j][1]) * (y - kCenters[j][1]);
          w[j] += area * std::exp(-r2 / (2 * 0.16));
        }
        w[3] += area;
      }
      weights.push_back(sees_floor ? w : Measures{});  // around the floor all is black
    }
  return weights;
}
Measures measures_of(const std::vector<float>& image, const Weights& weights) {
  Measures sums{};
  for (std::size_t pixel = 0; pixel < weights.size(); ++pixel)
    for (std::size_t j = 0; j < 4; ++j) sums[j] += static_cast<double>(image[pixel * 3]) * weights[pixel][j];
  return sums;
}

// The integrals of the row of glass, over places of the panel and of the floor: a place of the floor gets
// light that was meant for the place of which it is the image, and its own unless that lies in the source.
// The note's panel transmits 0.9 of the light in all directions, glass as Fresnel's equations say.
Measures through_glass(const std::function<double(double)>& transmittance) {
  using V = std::array<double, 3>;
  const auto dot = [](V a, V b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; };
  const auto minus = [](V a, V b) { return V{a[0] - b[0], a[1] - b[1], a[2] - b[2]}; };
  // Flux from a place of the panel to one of the floor, over the areas of both.
  const auto flux = [&](V x, V y) {
    const V d = minus(y, x);
    const double l = std::sqrt(dot(d, d)), cosine = d[0] / l;
    if (!(cosine > 0)) return 0.0;
    const double t = 1 / std::sqrt(1 - (1 - cosine * cosine) / 2.25);
    const V from = {-1, x[1] - t * d[1] / l / 1.5, x[2] - t * d[2] / l / 1.5};
    if (from[1] < 0 || from[1] > 3.5 || from[2] < 0.3 || from[2] > 3.3) return 0.0;
    const V r = minus(from, {-1, 1.6, 1.95});
    return transmittance(cosine) / 2.25 * std::exp(-dot(r, r) / 0.5) * cosine * -d[2] / (l * l * l);
  };
  const auto aims_at_source = [&](V x, V y) {
    const V d = minus(y, x), c = minus({1.2, 1.6, 0}, x);
    const double along = dot(c, d);
    return along > 0 && along * along >= (dot(c, c) - 0.25) * dot(d, d);
  };
  Measures sums{};
  constexpr int kPlaces = 1 << 21;
  std::array<double, 4> step{}, u{};
  // An additive recurrence by powers of the root of x^5 = x + 1.
  for (std::size_t k = 0; k < 4; ++k) step[k] = std::pow(1.1673039782614187, -static_cast<double>(k + 1));
  for (int i = 0; i < kPlaces; ++i) {
    for (std::size_t k = 0; k < 4; ++k) u[k] = std::fmod(u[k] + step[k], 1.0);
    const V x = {0, 4 * u[0], 0.8 + 2 * u[1]}, y = {4 * u[2], 4 * u[3], 0},
            meant = {1.2 + (y[0] - 1.6) / 1.6, 1.6 + (y[1] - 2) / 0.8, 0};
    double light = aims_at_source(x, y) ? 0 : flux(x, y);
    if (aims_at_source(x, meant)) light += flux(x, meant) / (1.6 * 0.8);
    light *= 8.0 * 16.0 / kPlaces * 0.7 / std::acos(-1.0);
    for (std::size_t j = 0; j < 3; ++j) {
      const double a = y[0] - kCenters[j][0], b = y[1] - kCenters[j][1];
      sums[j] += light * std::exp(-(a * a + b * b) / (2 * 0.16));
    }
    sums[3] += light;
  }
  return sums;
}
double fresnel_transmittance(double cosine) {
  const double inside = std::sqrt(1 - (1 - cosine * cosine) / 2.25);
  const double s = (cosine - 1.5 * inside) / (cosine + 1.5 * inside),
               p = (1.5 * cosine - inside) / (1.5 * cosine + inside);
  return 1 - (s * s + p * p) / 2;
}

class EditTable : public testing::TestWithParam<Row> {};

// Claim: the integrals of each row are those of the quadrature, in integrators whose walks know an edit's
// verdict and in those whose walks do not.
TEST_P(EditTable, IsThatOfTheNote) {
  Row row = GetParam();
  if (row.room.glass) {
    const Measures of_note = through_glass([](double) { return 0.9; });
    for (std::size_t j = 0; j < 4; ++j) EXPECT_NEAR(of_note[j], row.reference[j], 1e-3 * row.reference[j]);
    row.reference = through_glass(fresnel_transmittance);
  }
  const Weights weights = row.room.from_eye ? weights_from_eye() : weights_from_above();
  std::vector<std::string> integrators = {"bdpt"};
  if (row.edges > 3) integrators.emplace_back("path");
  if (long_form()) integrators = {"path", "light", "bdpt", "bpm", "vcm"};
  for (const std::string& integrator : integrators) {
    const bool merges = integrator == "bpm" || integrator == "vcm";
    const auto up_to = [&](int edges) {
      SettingsMap settings = {{"max_depth", std::to_string(edges)}};
      if (merges) settings["radius"] = "0.03";
      TestScene scene = with_integrator(scene_of(row.room), integrator, settings);
      scene.settings.edits = list_of(row.edits);
      return scene;
    };
    constexpr std::size_t kBatches = 24;
    const auto images =
        render_images({{1, up_to(row.edges)}, {-1, up_to(2)}}, {.seed = 5,
                                                                .batches = kBatches,
                                                                .iterations = (row.room.from_eye       ? 3u
                                                                               : integrator == "light" ? 16u
                                                                                                       : 6u) *
                                                                              (long_form() ? 8 : 1)});
    Measures mean{}, squares{};
    for (const auto& image : images) {
      const Measures m = measures_of(image, weights);
      for (std::size_t j = 0; j < 4; ++j) {
        mean[j] += m[j] / kBatches;
        squares[j] += m[j] * m[j] / kBatches;
      }
    }
    for (std::size_t j = 0; j < 4; ++j) {
      const double error = std::sqrt(std::max(0.0, squares[j] - mean[j] * mean[j]) / (kBatches - 1));
      EXPECT_NEAR(mean[j], row.reference[j], 5.5 * error + (merges ? 0.012 : 1.5e-3) * row.reference[j])
          << integrator << " h_" << j << ", " << (mean[j] - row.reference[j]) / error << " standard errors";
      EXPECT_LT(error, (j == 3 ? 0.01 : 0.03) * row.reference[j]) << integrator << " h_" << j;
      if (long_form())
        fmt::print("{} {} h_{}: {:+.5f} +- {:.5f}\n", row.name, integrator, j, mean[j] / row.reference[j] - 1,
                   error / row.reference[j]);
    }
  }
}
INSTANTIATE_TEST_SUITE_P(, EditTable, testing::ValuesIn(rows()),
                         [](const auto& one) { return one.param.name; });

}  // namespace
}  // namespace candela::statistical
