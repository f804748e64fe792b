// Edits of light transport in every integrator that renders them: against quadrature of the definition in a
// scene of a panel, a floor and a point light, and against light tracing at mirrors, glass and shading
// normals. Each comparison alarms falsely with probability at most 1e-5 (block_tests.h); there are fewer than
// 100 of them: the file alarms falsely with probability below 1e-3.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "common/edits/edits.h"
#include "tests/integrators.h"
#include "tests/proofs/proofs.h"
#include "tests/statistical/edited_estimators.h"
#include "tests/statistical/harness.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"EditedLight", "EditedLobes", "EditedByPath"});

struct Edit {
  std::string name, text;
};

constexpr std::uint32_t kSize = 16, kBlock = 4;

// ---- panel and floor ----

// Panel x = 0, 0 < y < 4, 0.8 < z < 2.8; floor z = 0, seen from above; light at (2.6, 1.2, 2.4).
std::string room_of(const std::string& panel_bsdf) {
  return R"(<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="3"/></integrator>
    <sensor type="perspective"><float name="fov" value="16"/>
      <transform name="to_world"><lookat origin="1.7, 2, 9" target="1.7, 2, 0" up="0, 1, 0"/></transform></sensor>
    <emitter type="point" id="bulb"><point name="position" x="2.6" y="1.2" z="2.4"/><rgb name="intensity" value="8"/></emitter>
    <shape type="rectangle" id="floor"><transform name="to_world"><scale value="4"/><translate x="3" y="2"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.6"/></bsdf></shape>
    <shape type="rectangle" id="panel"><transform name="to_world"><scale x="1" y="2"/><rotate y="1" angle="90"/>
      <translate y="2" z="1.8"/></transform>)" +
         panel_bsdf + "</shape></scene>";
}
const std::string kGlossy =
    R"(<bsdf type="phong"><float name="exponent" value="20"/><rgb name="specular_reflectance" value="0.8"/>
      <rgb name="diffuse_reflectance" value="0.15"/></bsdf>)";
const std::string kMatt = R"(<bsdf type="diffuse"><rgb name="reflectance" value="0.9"/></bsdf>)";
struct Lobes {
  double diffuse, specular;
};
constexpr Lobes kGlossyLobes{0.15, 0.8}, kMattLobes{0.9, 0};

// Edits of which the vertex alone decides.
struct PanelCase {
  Edit edit;
  bool glossy = true;
};
std::string wrapped(const std::string& edits) {
  return R"({"regions": {"gloss": {"box": [1.2, 0.8, -0.3, 2.4, 2.4, 0.3]}, "near": {"sphere": [1.2, 2.6, 0, 0.9]},
    "sky": {"box": [1, 0.5, 1.5, 4, 2, 3.5]}}, "edits": [)" +
         edits + "]}";
}
const std::string kTurnText =
    R"({"name": "turn", "direction": "light", "select": "LX*X{panel}", "rotate": {"axis": [0.2, 1, 0.3], "degrees": 20}})";
const std::string kHighlightText =
    R"({"name": "highlight", "direction": "light", "select": "LX*X{panel}", "source": "gloss",
      "move": {"to": [2, 2.9, 0], "normal": [0, 0, 1], "stretch": [0.8, 0.7, 1]}})";
const std::string kBleedingText =
    R"({"name": "bleeding", "direction": "light", "select": "LX*X{panel}", "source": "near",
      "move": {"to": [1.9, 1.7, 0], "normal": [0, 0, 1], "linear": [1.3, 0.2, 0, 0, 1.1, 0, 0, 0, 1]}})";
const std::vector<PanelCase>& panel_cases() {
  static const std::vector<PanelCase> all = {
      {{"rotation", wrapped(kTurnText)}},
      {{"affine", wrapped(R"({"name": "affine", "direction": "light", "select": "LX*X{panel}",
          "move": {"from": [2, 2, 0], "to": [1.6, 2.3, 0], "normal": [0, 0, 1], "linear": [1.5, 0.3, 0, 0, 0.8, 0, 0, 0, 1]}})")}},
      {{"highlight", wrapped(kHighlightText)}},
      {{"bleeding", wrapped(kBleedingText)}, false},
      {{"sequence", wrapped(kHighlightText + "," + kBleedingText)}},
      {
          {
              "gather",
              wrapped(R"({"name": "gather", "direction": "eye", "select": "X{panel}X*E", "source": "sky",
          "move": {"to": [2.2, 1.8, 2], "normal": [1, 0, 0], "stretch": [1, 1.4, 1.4]}, "tint": [1, 0.5, 0.8]})"),
          },
      },
      {{"both", wrapped(kHighlightText + R"(, {"name": "look", "direction": "eye", "select": "X{panel}X*E",
          "rotate": {"axis": [0, 1, 0], "degrees": 12}})")}},
  };
  return all;
}

// ---- quadrature ----

using V = std::array<double, 3>;
V operator+(V a, V b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
V operator-(V a, V b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
V operator*(V a, double s) {
  return {a[0] * s, a[1] * s, a[2] * s};
}
double dot(V a, V b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
V unit(V a) {
  return a * (1 / std::sqrt(dot(a, a)));
}
V cross(V a, V b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
double det3(V a, V b, V c) {
  return dot(a, cross(b, c));
}

// The matrix B of an edit at x, built from what it does to three directions, and its inverse by Cramer's
// rule.
struct Matrix {
  V column[3];
  double det() const { return det3(column[0], column[1], column[2]); }
  V solve(V o) const {
    const double d = det();
    return {det3(o, column[1], column[2]) / d, det3(column[0], o, column[2]) / d,
            det3(column[0], column[1], o) / d};
  }
};
Matrix matrix_of(const edits::Edit& edit, V x) {
  Matrix b;
  for (std::size_t i = 0; i < 3; ++i) {
    V v{};
    v[i] = 1;
    if (edit.rotate) {
      const V k = unit(edit.rotate->axis);
      const double a = edit.rotate->degrees * std::numbers::pi / 180;
      b.column[i] = v * std::cos(a) + cross(k, v) * std::sin(a) + k * (dot(k, v) * (1 - std::cos(a)));
    } else {
      const auto& l = edit.move->linear;
      const auto apply = [&](V u) {
        return V{dot({l[0], l[1], l[2]}, u), dot({l[3], l[4], l[5]}, u), dot({l[6], l[7], l[8]}, u)};
      };
      const V d = edit.move->from - x, e = edit.move->to - x, m = edit.move->normal.value_or(d);
      b.column[i] = apply(v) + (e - apply(d)) * (dot(m, v) / dot(m, d));
    }
  }
  return b;
}
bool aims_at(const letters::Region* region, V x, V w) {
  if (region == nullptr) return true;
  if (region->kind == letters::Region::Kind::sphere) {
    const V c = region->low - x;
    const double t = dot(c, w);
    return t > 0 && dot(c, c) - t * t <= region->radius * region->radius;
  }
  double near = 0, far = 1e30;
  for (std::size_t i = 0; i < 3; ++i) {
    const double a = (region->low[i] - x[i]) / w[i], b = (region->high[i] - x[i]) / w[i];
    near = std::max(near, std::min(a, b));
    far = std::min(far, std::max(a, b));
  }
  return near <= far;
}

struct Term {
  V w;
  double gamma;
  V factor;
};
// The directions that an edit of v sums over, in a surface of normal g; `matrices`: one an edit, of x.
std::vector<Term> terms_of(const edits::EditList& list, const std::vector<Matrix>& matrices, bool of_light,
                           V x, V g, V v) {
  std::vector<Term> terms = {{v, 1, {1, 1, 1}}};
  for (std::size_t k = list.edits.size(); k-- > 0;) {
    const edits::Edit& edit = list.edits[k];
    if ((edit.direction == edits::Edit::Direction::light) != of_light) continue;
    const letters::Region* region = edit.source.empty() ? nullptr : list.region(edit.source);
    const Matrix& b = matrices[k];
    std::vector<Term> before;
    for (const Term& t : terms) {
      const V back = b.solve(t.w);
      const double l = std::sqrt(dot(back, back));
      const V r = back * (1 / l);
      if (aims_at(region, x, r) && dot(r, g) * dot(t.w, g) > 0)
        before.push_back(
            {r,
             t.gamma * std::abs(dot(r, g) / dot(t.w, g)) / (std::abs(b.det()) * l * l * l),
             {t.factor[0] * edit.factor[0], t.factor[1] * edit.factor[1], t.factor[2] * edit.factor[2]}});
      if (!aims_at(region, x, t.w)) before.push_back(t);
    }
    terms = before;
  }
  return terms;
}

constexpr V kBulb{2.6, 1.2, 2.4}, kPanelNormal{1, 0, 0};
constexpr int kRows = 64, kColumns = 96;

// A cell of the panel: all that no point of the floor changes.
struct Cell {
  V x, i;  // center, direction to the bulb
  std::vector<Matrix> matrices;
  std::vector<Term> eye_terms;
};
std::vector<Cell> cells_of(const edits::EditList& list) {
  std::vector<Cell> cells;
  for (int row = 0; row < kRows; ++row)
    for (int column = 0; column < kColumns; ++column) {
      const V x{0, 4 * (column + 0.5) / kColumns, 0.8 + 2 * (row + 0.5) / kRows};
      Cell cell{x, unit(kBulb - x), {}, {}};
      for (const edits::Edit& edit : list.edits) cell.matrices.push_back(matrix_of(edit, x));
      cell.eye_terms = terms_of(list, cell.matrices, false, x, kPanelNormal, cell.i);
      cells.push_back(std::move(cell));
    }
  return cells;
}

// Radiance of the floor at y: the light's own, and by the panel.
V floor_radiance(const edits::EditList& list, const std::vector<Cell>& cells, const Lobes& lobes, V y) {
  const V bulb = kBulb, up{0, 0, 1}, g = kPanelNormal;
  const double intensity = 8, albedo = 0.6;
  const V to_bulb = bulb - y;
  const double r2 = dot(to_bulb, to_bulb);
  const double direct = intensity * dot(unit(to_bulb), up) / r2;
  V e{direct, direct, direct};
  const double area = 2.0 / kRows * 4.0 / kColumns;
  for (const Cell& cell : cells) {
    const V to_floor = y - cell.x, o = unit(to_floor);
    const double lit = intensity / dot(bulb - cell.x, bulb - cell.x);
    const double geometry = dot(o, g) * -dot(o, up) / dot(to_floor, to_floor) * area;
    // f'(i -> o) |i.g|, in which the cosine of i is the real one.
    for (const Term& a : terms_of(list, cell.matrices, true, cell.x, g, o))
      for (const Term& b : cell.eye_terms) {
        const V mirrored = g * (2 * dot(b.w, g)) - b.w;
        const double lobe = std::pow(std::max(0.0, dot(mirrored, a.w)), 20);
        const double f =
            lobes.diffuse / std::numbers::pi + lobes.specular * 22 / (2 * std::numbers::pi) * lobe;
        for (std::size_t c = 0; c < 3; ++c)
          e[c] += f * a.gamma * b.gamma * a.factor[c] * b.factor[c] * lit * dot(cell.i, g) * geometry;
      }
  }
  return e * (albedo / std::numbers::pi);
}

// Block means of the image, by an estimator that is exact.
Estimator quadrature(const PanelCase& c, const Regions& regions) {
  const auto list = edits::parse_edits(c.edit.text);
  if (!list.ok()) throw std::runtime_error(list.error().to_string());
  const std::vector<Cell> cells = cells_of(*list);
  std::vector<double> image;
  const double half = 9 * std::tan(8 * std::numbers::pi / 180);
  constexpr int kSub = 1;
  for (std::uint32_t row = 0; row < kSize; ++row)
    for (std::uint32_t column = 0; column < kSize; ++column) {
      V sum{};
      for (int s = 0; s < kSub * kSub; ++s) {
        const double fx = (column + (s % kSub + 0.5) / kSub) / kSize * 2 - 1,
                     fy = (row + (s / kSub + 0.5) / kSub) / kSize * 2 - 1;
        sum = sum + floor_radiance(*list, cells, c.glossy ? kGlossyLobes : kMattLobes,
                                   {1.7 + half * fx, 2 - half * fy, 0});
      }
      for (const double v : sum) image.push_back(v / (kSub * kSub));
    }
  const std::vector<double> means = regions.means(image);
  return {"quadrature of " + c.edit.name, [means](std::uint64_t, double) { return Rows(4, means); }};
}

// ---- integrators ----

void expect_equal(const Estimator& tested, const Estimator& reference, const Regions& regions, double margin,
                  double detectable) {
  const Verdict verdict = compare(tested, reference, regions, {.margin = margin});
  EXPECT_TRUE(verdict.agree) << verdict.report;
  EXPECT_GT(verdict.tested, regions.values() / 2) << verdict.report;
  EXPECT_LT(verdict.detectable_whole, detectable) << verdict.report;
}

class EditedLight : public testing::TestWithParam<std::string> {};

// Claim: each integrator renders each edit as the definition has it, place by place.
TEST_P(EditedLight, IsThatOfTheDefinition) {
  const std::string integrator = GetParam();
  const Regions regions(kSize, kSize, kBlock);
  const double margin = way_of(integrator).margin;
  for (const PanelCase& c : panel_cases()) {
    const bool all = integrator == "bdpt" || long_form();
    if (!all && c.edit.name != "sequence" && c.edit.name != "gather") continue;
    const TestScene scene = scene_from_xml(room_of(c.glossy ? kGlossy : kMatt), kSize, kSize);
    const Estimator tested = estimator_of(integrator, scene, c.edit.text, regions, 7);
    expect_equal(tested, quadrature(c, regions), regions, margin + 0.004, margin + 0.06);
  }
}

// ---- mirrors, glass, lobes, shading normals ----

// A ceiling lamp that eye paths can meet.
std::string lamp_scene(const std::string& shapes) {
  return R"(<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="4"/></integrator>
    <sensor type="perspective"><float name="fov" value="16"/>
      <transform name="to_world"><lookat origin="1.7, 2, 9" target="1.7, 2, 0" up="0, 1, 0"/></transform></sensor>
    <shape type="rectangle" id="lamp"><transform name="to_world"><scale value="0.5"/><rotate y="1" angle="-120"/>
      <translate x="3.8" y="1.2" z="2.4"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
      <emitter type="area"><rgb name="radiance" value="8"/></emitter></shape>
    <shape type="rectangle" id="floor"><transform name="to_world"><scale value="4"/><translate x="3" y="2"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.6"/></bsdf></shape>)" +
         shapes + "</scene>";
}
std::string panel_shape(const std::string& bsdf) {
  return R"(<shape type="rectangle" id="panel"><transform name="to_world"><scale x="1" y="2"/><rotate y="1" angle="90"/>
      <translate y="2" z="1.8"/></transform>)" +
         bsdf + "</shape>";
}

struct LobeCase {
  std::string name, shapes, edits;
  double detectable = 0.12;  // of eye paths that meet the lamp by chance
  friend void PrintTo(const LobeCase& c, std::ostream* out) { *out << c.name; }
};
const std::vector<LobeCase>& lobe_cases() {
  static const std::string mirror =
      panel_shape(R"(<bsdf type="conductor"><string name="material" value="none"/></bsdf>)");
  static const std::string glass =
      R"(<shape type="rectangle" id="pane"><transform name="to_world"><scale x="1.7" y="2"/><rotate y="1" angle="90"/>
        <translate x="3.2" y="2" z="1.71"/></transform>
        <bsdf type="dielectric"/></shape>)";
  static const std::string plastic = panel_shape(
      R"(<bsdf type="roughplastic"><float name="alpha" value="0.25"/><rgb name="diffuse_reflectance" value="0.7, 0.3, 0.5"/></bsdf>)");
  static const std::string coated =
      panel_shape(R"(<bsdf type="plastic"><rgb name="diffuse_reflectance" value="0.7, 0.3, 0.5"/></bsdf>)");
  static const std::vector<LobeCase> all = {
      {"turned_mirror", mirror,
       wrapped(
           R"({"name": "a", "direction": "light", "select": "LX*S{panel}", "rotate": {"axis": [0, 1, 0.4], "degrees": 8}})")},
      {"mirror_region", mirror,
       wrapped(R"({"name": "a", "direction": "light", "select": "LX*S{panel}", "source": "gloss",
          "move": {"to": [1.5, 2.7, 0], "normal": [0, 0, 1], "stretch": [1.4, 1.2, 1]}})")},
      {"mirror_gathers", mirror,
       wrapped(R"({"name": "a", "direction": "eye", "select": "S{panel}X*E", "source": "sky",
          "move": {"to": [2.6, 1.6, 2.2], "normal": [1, 0, 0.5], "stretch": [1, 1.3, 1]}})")},
      {"glass_region", glass,
       wrapped(R"({"name": "a", "direction": "light", "select": "LX*ST{pane}", "source": "gloss",
          "move": {"to": [1.5, 2.4, 0], "normal": [0, 0, 1], "stretch": [1.2, 1.1, 1]}})"),
       0.9},
      {"gloss_alone", plastic,
       wrapped(R"({"name": "a", "direction": "light", "select": "LX*G{panel}", "source": "gloss",
          "move": {"to": [1.5, 2.7, 0], "normal": [0, 0, 1]}})")},
      {"mirror_of_two_lobes", coated,
       wrapped(
           R"({"name": "a", "direction": "light", "select": "LX*S{panel}", "rotate": {"axis": [0, 1, 0.4], "degrees": 8}})")},
  };
  return all;
}

class EditedLobes : public testing::TestWithParam<LobeCase> {};

// Claim: at delta lobes, which walks in one direction alone find, and where an edit selects one lobe of two,
// walks from the eye, from the light and from both agree.
TEST_P(EditedLobes, AreTheSameFromBothEnds) {
  const LobeCase& c = GetParam();
  const Regions regions(kSize, kSize, kBlock);
  const TestScene scene = scene_from_xml(lamp_scene(c.shapes), kSize, kSize);
  const Estimator reference = cached(estimator_of("light", scene, c.edits, regions, 8));
  for (const std::string integrator : {"path", "bdpt"})
    expect_equal(estimator_of(integrator, scene, c.edits, regions, 9), reference, regions, 0,
                 integrator == "path" ? c.detectable : 0.12);
}

// ---- selections by the path ----

const std::vector<LobeCase>& path_cases() {
  static const std::string mirror =
      panel_shape(R"(<bsdf type="conductor"><string name="material" value="none"/></bsdf>)");
  static const std::string matt = panel_shape(kMatt), glossy = panel_shape(kGlossy);
  static const std::string fog =
      matt +
      R"(<shape type="cube"><transform name="to_world"><scale x="0.8" y="0.8" z="0.4"/><translate x="1.6" y="2" z="1.5"/></transform>
        <bsdf type="null"/><medium name="interior" type="homogeneous" id="fog"><rgb name="sigma_t" value="0.8"/>
        <rgb name="albedo" value="0.9"/></medium></shape>)";
  static const std::string move = R"("source": "gloss", "move": {"to": [1.5, 2.7, 0], "normal": [0, 0, 1],
      "stretch": [1.4, 1.2, 1]})";
  static const auto all_of = [](const std::string& light, const std::string& eye) {
    std::string list;
    if (!light.empty())
      list = R"({"name": "a", "direction": "light", "select": ")" + light + "\", " + move + "}";
    if (!eye.empty())
      list += (light.empty() ? "" : ", ") + (R"({"name": "b", "direction": "eye", "select": ")" + eye) +
              R"(", "rotate": {"axis": [0.2, 1, 0.3], "degrees": 15}, "tint": [1, 0.5, 0.8]})";
    return wrapped(list);
  };
  static const std::vector<LobeCase> all = {
      {"prefix", glossy, all_of("LX{floor}X{panel}", "")},
      {"prefix_mirror", mirror, all_of("LX{floor}S{panel}", "")},
      {"suffix", matt, all_of("", "X{floor}X{panel}X*E")},
      {"suffix_mirror", mirror, all_of("", "X{floor}S{panel}X*E")},
      {"both", matt, all_of("LX+X{panel}", "X{panel}XX+E"), 0.2},
      {"fog", fog, all_of("LVX{panel}", "XVX{floor}E"), 0.2},
  };
  return all;
}

class EditedByPath : public testing::TestWithParam<LobeCase> {};

// Claim: of a selection by the path, too, walks from the eye and from the light make one image, each of which
// knows the verdict of edits of its own direction alone; and both together, photons, and chains, do.
TEST_P(EditedByPath, IsTheSameFromBothEnds) {
  const LobeCase& c = GetParam();
  const Regions regions(kSize, kSize, kBlock);
  TestScene scene = scene_from_xml(lamp_scene(c.shapes), kSize, kSize);
  scene.from_scene["max_depth"] = "5";
  const Estimator reference = cached(estimator_of("light", scene, c.edits, regions, 8));
  std::vector<std::string> integrators = {"path", "bdpt", "vcm"};
  if (long_form()) integrators.insert(integrators.end(), {"ppm", "bpm", "pssmlt", "mmlt"});
  for (const std::string& integrator : integrators) {
    const double margin = way_of(integrator).margin;
    expect_equal(estimator_of(integrator, scene, c.edits, regions, 9), reference, regions, margin,
                 margin + (integrator == "bdpt" || integrator == "vcm" ? 0.12 : std::max(0.2, c.detectable)));
  }
}

// Claim: edits of light that came by the floor first change the paths that did, and no others: of paths of
// four edges all did, of shorter ones none.
TEST(EditedPrefix, ChangesThePathsThatItNames) {
  const Regions regions(kSize, kSize, kBlock);
  const auto term = [&](double weight, const char* integrator, const std::string& select, const char* depth) {
    TestScene scene =
        with_integrator(scene_from_xml(room_of(kGlossy), kSize, kSize), integrator, {{"max_depth", depth}});
    if (!select.empty())
      scene.settings.edits = wrapped(R"({"name": "a", "direction": "light", "select": ")" + select +
                                     R"(", "rotate": {"axis": [0.2, 1, 0.3], "degrees": 20}, "scale": 4})");
    return statistical::Term{weight, scene};
  };
  const Estimator reference = cached(make_estimator(
      "sum of parts",
      {term(1, "bdpt", "", "3"), term(1, "bdpt", "LX*X{panel}", "4"), term(-1, "bdpt", "LX*X{panel}", "3")},
      {.seed = 3, .batches = 12, .iterations = 32}, regions));
  for (const char* integrator : {"path", "light", "bdpt"})
    expect_equal(make_estimator(integrator, {term(1, integrator, "LX{floor}X{panel}", "4")},
                                {.seed = 4, .batches = 12, .iterations = 48}, regions),
                 reference, regions, 0, 0.1);
}

// Claim: where shading normals differ from the geometric ones it is so, too, for edits of light and of the
// eye.
TEST(EditedShadingNormals, AreTheSameFromBothEnds) {
  const std::string panel =
      R"(<shape type="obj" id="panel"><string name="filename" value="panel.obj"/>)" + kGlossy + "</shape>";
  const std::string obj =
      "v 0 0 0.8\nv 0 4 0.8\nv 0 4 2.8\nv 0 0 2.8\nvn 1 0.3 0.2\nvn 1 -0.4 0.1\nvn 1 -0.2 -0.3\nvn 1 0.3 "
      "-0.2\n"
      "f 1//1 2//2 3//3\nf 1//1 3//3 4//4\n";
  TestScene scene;
  scene.files = std::make_shared<MemorySource>(
      std::map<std::string, std::string>{{"scene.xml", lamp_scene(panel)}, {"panel.obj", obj}});
  scene.main_key = "scene.xml";
  scene = read_scene(std::move(scene), kSize, kSize);
  const Regions regions(kSize, kSize, kBlock);
  for (const std::string& edits :
       {wrapped(kTurnText),
        wrapped(R"({"name": "gather", "direction": "eye", "select": "X{panel}X*E", "source": "sky",
          "move": {"to": [2.2, 1.8, 2], "normal": [1, 0, 0], "stretch": [1, 1.4, 1.4]}})")}) {
    const Estimator reference = cached(estimator_of("light", scene, edits, regions, 8));
    for (const char* integrator : {"path", "bdpt"})
      expect_equal(estimator_of(integrator, scene, edits, regions, 9), reference, regions, 0, 0.1);
  }
}

// Claim: light of a constant sky is the same from everywhere: what a plate gathers from one place in place of
// another does not change its image.
TEST(EditedFurnace, IsAsItWas) {
  const std::string xml =
      R"(<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="2"/></integrator>
    <sensor type="perspective"><float name="fov" value="30"/>
      <transform name="to_world"><lookat origin="1, 2, 4" target="0, 0, 0" up="0, 1, 0"/></transform></sensor>
    <emitter type="constant"/>
    <shape type="rectangle" id="panel"><transform name="to_world"><scale value="4"/></transform>
      <bsdf type="roughconductor"><float name="alpha" value="0.3"/></bsdf></shape></scene>)";
  const std::string edits =
      R"({"regions": {"a": {"sphere": [-1, -1, 3, 1]}}, "edits": [{"name": "a", "direction": "eye",
      "select": "X{panel}X*E", "source": "a", "move": {"to": [1, 1.5, 3], "stretch": [1.3, 1, 1]}}]})";
  const Regions regions(kSize, kSize, kBlock);
  const TestScene scene = scene_from_xml(xml, kSize, kSize);
  const Estimator reference = cached(estimator_of("path", scene, "", regions, 3));
  for (const char* integrator : {"path", "bdpt"})
    expect_equal(estimator_of(integrator, scene, edits, regions, 4), reference, regions, 0, 0.02);
}

std::vector<std::string> able() {
  return {"path", "light", "bdpt", "ppm", "bpm", "vcm", "pssmlt", "mmlt"};
}
INSTANTIATE_TEST_SUITE_P(, EditedLight, testing::ValuesIn(able()), [](const auto& one) { return one.param; });
INSTANTIATE_TEST_SUITE_P(, EditedByPath, testing::ValuesIn(path_cases()),
                         [](const auto& one) { return one.param.name; });
INSTANTIATE_TEST_SUITE_P(, EditedLobes, testing::ValuesIn(lobe_cases()),
                         [](const auto& one) { return one.param.name; });

}  // namespace
}  // namespace candela::statistical
