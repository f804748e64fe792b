// Rows of the table of the retargeting note (section 9), and of its table of a selection by the path (section
// 7), through the renderer: integrals over the floor of a panel's light, against quadrature to 1e-4. The
// floor is seen from above; its radiance is that for the note's eye, too. An integral over three Gaussians
// and 1 is a sum over pixels with the Gaussians' means over each, which is right to 1e-3. With 24 batches a
// value is 5.5 standard errors off with probability 1.4e-5; there are 64 values: the file alarms falsely with
// probability below 1e-3.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "tests/proofs/proofs.h"
#include "tests/statistical/harness.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"EditTable"});

constexpr std::uint32_t kPixels = 64;

const char* const kRoom =
    R"(<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="3"/></integrator>
    <sensor type="orthographic"><transform name="to_world"><scale x="2" y="2"/>
      <lookat origin="2, 2, 9" target="2, 2, 0" up="0, 1, 0"/></transform></sensor>
    <emitter type="point"><point name="position" x="2.6" y="1.2" z="2.4"/><rgb name="intensity" value="1"/></emitter>
    <shape type="rectangle" id="floor"><transform name="to_world"><scale value="2"/><translate x="2" y="2"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.7"/></bsdf></shape>
    <shape type="rectangle" id="panel"><transform name="to_world"><scale x="1" y="2"/><rotate y="1" angle="90"/>
      <translate y="2" z="1.8"/></transform>
      <bsdf type="phong"><float name="exponent" value="20"/><rgb name="specular_reflectance" value="0.6"/>
        <rgb name="diffuse_reflectance" value="0.2"/></bsdf></shape></scene>)";

using Measures = std::array<double, 4>;

struct Row {
  std::string name, edits;
  int edges;  // of the longest path; paths of two edges, straight from the lamp, do not count
  Measures reference;
  friend void PrintTo(const Row& row, std::ostream* out) { *out << row.name; }
};

// A lobe of exponent 20 has roughness 0.3015.
std::string list_of(const std::string& edits) {
  return R"({"glossy_below": 0.5, "regions": {"near": {"sphere": [2.2, 1.3, 0, 0.8]}, "next": {"sphere": [2, 1.8, 0, 0.9]}},
    "edits": [)" +
         edits + "]}";
}
std::string edit(const std::string& name, const std::string& select, const std::string& rest) {
  return fmt::format(R"({{"name": "{}", "direction": "light", "select": "{}", {}}})", name, select, rest);
}

const std::string kRotation = R"("rotate": {"axis": [0, 0.6, 0.8], "degrees": 20})";
std::string moved(const std::string& to) {
  return R"("move": {"from": [2.2, 1.3, 0], "to": )" + to +
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
Measures measures_of(const std::vector<float>& image) {
  constexpr std::array<std::array<double, 2>, 3> kCenters = {{{2.2, 1.3}, {1.6, 2.8}, {2.6, 2.6}}};
  constexpr double kSide = 4.0 / kPixels;
  Measures sums{};
  for (std::uint32_t row = 0; row < kPixels; ++row)
    for (std::uint32_t column = 0; column < kPixels; ++column) {
      const double x = column * kSide, y = 4 - (row + 1) * kSide,
                   radiance = static_cast<double>(image[(row * kPixels + column) * 3]);
      for (std::size_t j = 0; j < 3; ++j)
        sums[j] += radiance * gaussian(x, x + kSide, kCenters[j][0]) * gaussian(y, y + kSide, kCenters[j][1]);
      sums[3] += radiance * kSide * kSide;
    }
  return sums;
}

class EditTable : public testing::TestWithParam<Row> {};

// Claim: the integrals of each row are those of the quadrature, in integrators whose walks know an edit's
// verdict and in those whose walks do not.
TEST_P(EditTable, IsThatOfTheNote) {
  const Row& row = GetParam();
  std::vector<std::string> integrators = {"bdpt"};
  if (row.edges > 3) integrators.emplace_back("path");
  if (long_form()) integrators = {"path", "light", "bdpt"};
  for (const std::string& integrator : integrators) {
    const auto up_to = [&](int edges) {
      TestScene scene = with_integrator(scene_from_xml(kRoom, kPixels, kPixels), integrator,
                                        {{"max_depth", std::to_string(edges)}});
      scene.settings.edits = list_of(row.edits);
      return scene;
    };
    constexpr std::size_t kBatches = 24;
    const auto images =
        render_images({{1, up_to(row.edges)}, {-1, up_to(2)}},
                      {.seed = 5,
                       .batches = kBatches,
                       .iterations = (integrator == "light" ? 16u : 6u) * (long_form() ? 8 : 1)});
    Measures mean{}, squares{};
    for (const auto& image : images) {
      const Measures m = measures_of(image);
      for (std::size_t j = 0; j < 4; ++j) {
        mean[j] += m[j] / kBatches;
        squares[j] += m[j] * m[j] / kBatches;
      }
    }
    for (std::size_t j = 0; j < 4; ++j) {
      const double error = std::sqrt(std::max(0.0, squares[j] - mean[j] * mean[j]) / (kBatches - 1));
      EXPECT_NEAR(mean[j], row.reference[j], 5.5 * error + 1.5e-3 * row.reference[j])
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
