// Edits of what lamps emit, of what media scatter, and of directions whose first surface lies in a region
// (`hit`), in every integrator that renders edits: against light tracing, which alone turns what leaves a
// lamp without asking what may have been meant. Each comparison alarms falsely with probability at most 1e-5
// (block_tests.h); there are fewer than 100 of them: the file alarms falsely with probability below 1e-3.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/integrators.h"
#include "tests/proofs/proofs.h"
#include "tests/statistical/edited_estimators.h"
#include "tests/statistical/harness.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"EditedPlaces"});

constexpr std::uint32_t kSize = 16, kBlock = 4;

struct PlaceCase {
  std::string name, lamps, shapes, edits;
  double detectable = 0.12;
  friend void PrintTo(const PlaceCase& c, std::ostream* out) { *out << c.name; }
};

// A floor z = 0, seen from above, and a panel x = 0.
std::string scene_text(const PlaceCase& c) {
  return R"(<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="4"/></integrator>
    <sensor type="perspective"><float name="fov" value="16"/>
      <transform name="to_world"><lookat origin="1.7, 2, 9" target="1.7, 2, 0" up="0, 1, 0"/></transform></sensor>
    <shape type="rectangle" id="floor"><transform name="to_world"><scale value="4"/><translate x="3" y="2"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.6"/></bsdf></shape>
    <shape type="rectangle" id="panel"><transform name="to_world"><scale x="1" y="2"/><rotate y="1" angle="90"/>
      <translate y="2" z="1.8"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.9"/></bsdf></shape>)" +
         c.lamps + c.shapes + "</scene>";
}

const std::vector<PlaceCase>& place_cases() {
  static const std::string area =
      R"(<shape type="rectangle" id="lamp"><transform name="to_world"><scale value="0.5"/><rotate y="1" angle="-120"/>
      <translate x="3.8" y="1.2" z="2.4"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
      <emitter type="area"><rgb name="radiance" value="8"/></emitter></shape>)";
  static const std::string points =
      R"(<emitter type="point" id="bulb"><point name="position" x="2.6" y="1.2" z="2.4"/><rgb name="intensity" value="6"/></emitter>
      <emitter type="spot" id="spot"><float name="cutoff_angle" value="30"/><rgb name="intensity" value="20"/>
        <transform name="to_world"><lookat origin="2.4, 3, 2.6" target="1.6, 2.2, 0" up="0, 1, 0"/></transform></emitter>)";
  static const std::string fog =
      R"(<shape type="cube"><transform name="to_world"><scale x="0.8" y="0.8" z="0.4"/><translate x="1.6" y="2" z="1.5"/></transform>
        <bsdf type="null"/><medium name="interior" type="homogeneous" id="fog"><rgb name="sigma_t" value="0.8"/>
        <rgb name="albedo" value="0.9"/><phase type="hg"><float name="g" value="0.5"/></phase></medium></shape>)";
  // It hides a part of the floor from the panel, above that part.
  static const std::string blocker =
      R"(<shape type="rectangle" id="blocker"><transform name="to_world"><scale x="0.3" y="0.5"/>
        <translate x="0.9" y="2" z="0.7"/></transform><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>)";
  static const auto wrapped = [](const std::string& edits) {
    return R"({"regions": {"gloss": {"box": [1.2, 0.8, -0.3, 2.4, 2.4, 0.3]}, "near": {"sphere": [1.6, 2.2, 0, 0.9]},
      "sky": {"box": [1, 0.5, 1.5, 4, 2, 3.5]}, "middle": {"sphere": [1.6, 2, 1.5, 0.5]}}, "edits": [)" +
           edits + "]}";
  };
  static const auto light = [](const std::string& name, const std::string& select, const std::string& rest) {
    return R"({"name": ")" + name + R"(", "direction": "light", "select": ")" + select + "\", " + rest + "}";
  };
  static const std::string turn = R"("rotate": {"axis": [0.2, 1, 0.3], "degrees": 20})",
                           move = R"("source": "gloss", "move": {"to": [1.5, 2.7, 0], "normal": [0, 0, 1],
      "stretch": [1.4, 1.2, 1]})",
                           near = R"("source": "near", "move": {"to": [1.9, 1.7, 0], "normal": [0, 0, 1],
      "stretch": [0.7, 0.8, 1]}, "tint": [1, 0.5, 0.8])";
  static const std::string gather =
      R"({"name": "gather", "direction": "eye", "select": "V{fog}[XV]*E", "source": "sky",
        "move": {"to": [2.2, 1.8, 2], "normal": [1, 0, 0.4], "stretch": [1, 1.4, 1.4]}})";
  static const std::vector<PlaceCase> all = {
      {"area_lamp", area, "", wrapped(light("a", "L{lamp}", move) + "," + light("b", "L", turn))},
      {"point_lamps", points, "", wrapped(light("a", "L{spot}", turn) + "," + light("b", "L", near))},
      {"lamp_and_panel", area, "", wrapped(light("a", "L|LX{panel}", move))},
      {"fog", area, fog, wrapped(light("a", "L[XV]*V{fog}", near) + "," + light("b", "L[XV]*V{fog}", turn)),
       0.15},
      {"fog_gathers", area, fog, wrapped(gather), 0.15},
      {"fog_both", points, fog, wrapped(light("a", "L[XV]*V@middle ", move) + "," + gather), 0.15},
      {"fog_by_path", area, fog, wrapped(light("a", "LV", move) + "," + light("b", "LVX{panel}", turn)), 0.2},
      {"first_surface", area, blocker, wrapped(light("a", "LX*X{panel}", R"("hit": true, )" + near))},
      {"first_surface_of_lamp", points, blocker,
       wrapped(light("a", "L{bulb}", R"("hit": true, )" + move) + "," +
               light("b", "L{spot}", R"("hit": true, )" + near))},
      {"first_surface_by_path", area, blocker,
       wrapped(
           light("a", "LX{floor}X{panel}", R"("hit": true, )" + near) +
           R"(, {"name": "b", "direction": "eye", "select": "X{panel}X{floor}E", "source": "sky", "hit": true,
          "rotate": {"axis": [0, 1, 0], "degrees": 20}})"),
       0.15},
  };
  return all;
}

class EditedPlaces : public testing::TestWithParam<PlaceCase> {};

// Claim: walks from the eye, from the light and from both, photons and chains make one image.
TEST_P(EditedPlaces, AreTheSameFromBothEnds) {
  const PlaceCase& c = GetParam();
  const Regions regions(kSize, kSize, kBlock);
  const TestScene scene = scene_from_xml(scene_text(c), kSize, kSize);
  const Estimator reference = cached(estimator_of("light", scene, c.edits, regions, 8));
  std::vector<std::string> integrators = {"path", "bdpt", "vcm"};
  if (long_form()) integrators.insert(integrators.end(), {"ppm", "bpm", "pssmlt", "mmlt"});
  for (const std::string& integrator : integrators) {
    const double margin = way_of(integrator).margin;
    const Verdict verdict =
        compare(estimator_of(integrator, scene, c.edits, regions, 9), reference, regions, {.margin = margin});
    EXPECT_TRUE(verdict.agree) << verdict.report;
    EXPECT_GT(verdict.tested, regions.values() / 2) << verdict.report;
    EXPECT_LT(verdict.detectable_whole, margin + c.detectable) << verdict.report;
  }
}

INSTANTIATE_TEST_SUITE_P(, EditedPlaces, testing::ValuesIn(place_cases()),
                         [](const auto& one) { return one.param.name; });

}  // namespace
}  // namespace candela::statistical
