// Lamps whose light edits turn as it leaves (worker/scene/emitters/edited_light.h), in scenes of a lamp and a
// floor: against the emission of the same lamp without edits, each direction sent where the edits send it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "edits_fixture.h"
#include "worker/scene/edits/edit_request.h"
#include "worker/scene/emitters/lights.h"

namespace candela::scene {
namespace {

struct LampCase {
  std::string name, lamp, edits;
  bool point = true, hit = false;
  friend void PrintTo(const LampCase& c, std::ostream* out) { *out << c.name; }
};

// At the origin, but for errors of places; an area lamp is so small that all of it is one place.
const std::string
    kPoint = R"(<emitter type="point" id="lamp"/>)",
    kSpot =
        R"(<emitter type="spot" id="lamp"><float name="cutoff_angle" value="50"/>
        <transform name="to_world"><lookat origin="0, 0, 0" target="0.3, 0.2, 1" up="0, 1, 0"/></transform></emitter>)",
    kProjector =
        R"(<emitter type="projector" id="lamp"><float name="fov" value="80"/>
        <transform name="to_world"><lookat origin="0, 0, 0" target="0.3, 0.2, 1" up="0, 1, 0"/></transform></emitter>)",
    kArea =
        R"(<shape type="rectangle" id="lamp"><transform name="to_world"><scale value="1e-3"/></transform>
        <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
        <emitter type="area"><rgb name="radiance" value="3"/></emitter></shape>)";
std::string of_lamps(std::string edit) {
  for (const char* select : {"LX*X", "XX*E"})
    if (const std::size_t at = edit.find(select); at != std::string::npos) edit.replace(at, 4, "L");
  return edit;
}
const std::vector<LampCase>& lamp_cases() {
  static const std::string turn = of_lamps(kTurn), move = of_lamps(kMove), highlight = of_lamps(kHighlight),
                           second = of_lamps(kSecond), tint = of_lamps(kTint);
  static const std::string first =
      R"({"name": "first", "direction": "light", "select": "L", "source": "spot", "hit": true,
        "move": {"to": [-1.5, 0.5, 3], "normal": [0, 0, 1], "stretch": [1.3, 0.8, 1]}})";
  static const std::vector<LampCase> all = {
      {"point_turned", kPoint, turn},
      {"point_moved", kPoint, move},
      {"point_region", kPoint, highlight},
      {"point_sequence", kPoint, highlight + "," + second},
      {"point_tinted", kPoint, tint},
      {"point_first", kPoint, first, true, true},
      {"spot_turned", kSpot, turn},
      {"spot_sequence", kSpot, second + "," + highlight},
      {"projector_moved", kProjector, move},
      {"area_turned", kArea, turn, false},
      {"area_moved", kArea, move, false},
      {"area_sequence", kArea, highlight + "," + second, false},
      {"area_first", kArea, first, false, true},
  };
  return all;
}

struct Lit {
  edits::EditList list;
  std::unique_ptr<Scene> scene, plain;
};
Lit lit_by(const LampCase& c) {
  // A floor at z = 3, half of it behind a blocker, which `hit` tells from the region behind.
  const std::string body =
      c.lamp +
      R"(<shape type="rectangle" id="floor"><transform name="to_world"><scale value="40"/><translate z="3"/></transform></shape>
      <shape type="rectangle" id="blocker"><transform name="to_world"><scale value="0.5"/><translate x="1.2" z="2"/></transform></shape>)";
  Lit lit;
  lit.list = *edits::parse_edits(R"({"regions": {"up": {"sphere": [1.2, 0.4, 1.1, 0.6]},
      "side": {"box": [-2, -1, 0.3, -0.7, 1, 1.5]}, "spot": {"sphere": [1.2, 0.4, 3, 1]}}, "edits": [)" +
                                 c.edits + "]}");
  const auto built = [&](bool edited) {
    EditRequest request;
    request.list = lit.list;
    Scene::Options options;
    if (edited) options.edits = &request;
    auto scene = test::build_scene(body, {}, "", options);
    EXPECT_TRUE(scene.ok()) << (scene.ok() ? "" : scene.error().to_string());
    return std::move(*scene);
  };
  lit.scene = built(true);
  lit.plain = built(false);
  return lit;
}

// The edits send light that leaves x along `along` into `out`. False: it is lost.
bool sent(const LampCase& c, const Lit& lit, Vec3 x, Vec3 along, Vec3& out, double& factor) {
  Vec3d w(along);
  factor = 1;
  for (const edits::Edit& edit : lit.list.edits) {
    const Cone region = cone_of(lit.list, edit);
    SurfaceHit met;
    const bool aims =
        c.hit ? lit.plain->intersect({x + Vec3(w) * 1e-5f, Vec3(w)}, met) && encloses(region, Vec3d(met.p))
              : contains(region, Vec3d(x), w);
    if (!aims) continue;
    Vec3d o = w;
    if (edit.rotate || edit.move) {
      MapAtVertex map;
      const DirectionMap of_edit = direction_map(edit);
      if (!map.set(of_edit, Vec3d(x))) continue;
      o = map.forward(w);
    }
    if (!c.point && !(o.z * w.z > 0)) return false;
    factor *= edit.factor[1];
    w = o;
  }
  out = Vec3(w);
  return true;
}

class EditedLamps : public testing::TestWithParam<LampCase> {};

// Claim: light that leaves an edited lamp is that of the lamp without edits, each direction sent where the
// edits send it: with the same random numbers the directions are those, and sums over tests of directions
// are the same. The densities that are told of a direction are those of its sample, and they make the weight.
TEST_P(EditedLamps, EmitWhatTheDefinitionTurns) {
  const LampCase& c = GetParam();
  const Lit lit = lit_by(c);
  rng::Stream stream(rng::key(3));
  constexpr int kSamples = 20000;
  std::array<double, kTests> edited{}, turned{}, squares{};
  int lost = 0, drawn = 0, moved = 0;
  for (int i = 0; i < kSamples; ++i) {
    const float u = stream.next_float();
    const Vec2 position{stream.next_float(), stream.next_float()},
        direction{stream.next_float(), stream.next_float()};
    EmissionSample plain, now;
    ASSERT_TRUE(lit.plain->sample_emission(u, position, direction, plain));
    const bool any = lit.scene->sample_emission(u, position, direction, now);
    Vec3 o;
    double factor = 1;
    const bool stays = sent(c, lit, plain.vertex.p, plain.ray.direction, o, factor);
    std::array<double, kTests> difference{};
    if (stays) {
      const auto t = tests_of(o);
      for (std::size_t k = 0; k < kTests; ++k)
        difference[k] -= static_cast<double>(plain.weight.g) * factor * t[k];
      for (std::size_t k = 0; k < kTests; ++k) turned[k] -= difference[k] / kSamples;
      moved += dot(o, plain.ray.direction) < 1 - 1e-5f;
    }
    lost += !stays;
    if (any) {
      ++drawn;
      EXPECT_TRUE(stays);
      EXPECT_GT(dot(o, now.ray.direction), 1 - 1e-5f) << i;
      EXPECT_EQ(now.vertex.p, plain.vertex.p);
      EmissionDensity density;
      if (c.point) {
        DirectSample seen;
        seen.wi = -now.ray.direction;
        seen.p = now.vertex.p;
        seen.emitter = 0;
        ASSERT_TRUE(lit.scene->pdf_emission(seen, density));
      } else {
        ASSERT_TRUE(lit.scene->pdf_emission(now.vertex, now.ray.direction, density));
        EXPECT_NEAR(lit.scene->emitted(now.vertex, now.ray.direction).g / now.radiance.g, 1, 2e-3);
      }
      EXPECT_NEAR(density.pdf_solid_angle / now.pdf_solid_angle, 1, 2e-3);
      EXPECT_NEAR(now.weight.g * density.prob * density.pdf_area * density.pdf_solid_angle /
                      (now.radiance.g * density.cosine),
                  1, 2e-3);
      const auto t = tests_of(now.ray.direction);
      for (std::size_t k = 0; k < kTests; ++k) {
        difference[k] += static_cast<double>(now.weight.g) * t[k];
        edited[k] += static_cast<double>(now.weight.g) * t[k] / kSamples;
      }
    }
    for (std::size_t k = 0; k < kTests; ++k) squares[k] += difference[k] * difference[k];
  }
  EXPECT_GT(drawn, kSamples / 4);
  EXPECT_NEAR(drawn + lost, kSamples, 0.03 * kSamples + (c.name == "point_tinted" ? kSamples : 0));
  if (c.name != "point_tinted") {
    EXPECT_GT(moved, kSamples / 100);
  }
  for (std::size_t k = 0; k < kTests; ++k)
    EXPECT_NEAR(edited[k], turned[k], 4.5 * std::sqrt(squares[k]) / kSamples + 2e-3 * turned[0])
        << c.name << " " << k;
}

// Claim: light seen from a place is that which leaves towards it: the integral over all places around a
// lamp is that of samples that leave it, in each test, and so is that of the densities.
TEST_P(EditedLamps, AreSeenAsTheyEmit) {
  const LampCase& c = GetParam();
  const Lit lit = lit_by(c);
  constexpr int kSamples = 40000;
  std::array<double, kTests> seen{}, emitted{}, squares{};
  double density = 0, drawn = 0;
  const double lamp_area = c.point ? 1 : 4e-6;
  over_sphere([&](Vec3 d, double area) {
    EmissionDensity told;
    DirectSample light;
    if (c.point) {
      DirectSample from;
      from.wi = -d;
      from.emitter = 0;
      if (lit.scene->pdf_emission(from, told)) density += static_cast<double>(told.pdf_solid_angle) * area;
    }
    const SurfaceHit reference = test::point_reference(d * 0.9f);
    if (lit.scene->sample_direct(reference, {}, 0.5f, {0.5f, 0.5f}, light) != DirectOutcome::sampled) return;
    const Vec3 o = -light.wi;
    const double of_place = c.point ? 0.9f * 0.9f : std::max(0.0f, o.z);
    const auto t = tests_of(o);
    for (std::size_t k = 0; k < kTests; ++k)
      seen[k] += static_cast<double>(light.radiance.g) * of_place * lamp_area * t[k] * area;
  });
  rng::Stream stream(rng::key(4));
  for (int i = 0; i < kSamples; ++i) {
    const float u = stream.next_float();
    const Vec2 position{stream.next_float(), stream.next_float()},
        direction{stream.next_float(), stream.next_float()};
    EmissionSample now;
    if (!lit.scene->sample_emission(u, position, direction, now)) continue;
    drawn += 1.0 / kSamples;
    const auto t = tests_of(now.ray.direction);
    for (std::size_t k = 0; k < kTests; ++k) {
      const double x = static_cast<double>(now.weight.g) * t[k];
      emitted[k] += x / kSamples;
      squares[k] += x * x / kSamples;
    }
  }
  for (std::size_t k = 0; k < kTests; ++k)
    EXPECT_NEAR(
        seen[k], emitted[k],
        4.5 * std::sqrt(std::max(0.0, squares[k] - emitted[k] * emitted[k]) / kSamples) + 0.01 * emitted[0])
        << c.name << " " << k;
  if (c.point && c.name != "point_tinted") {
    EXPECT_NEAR(density, drawn, 0.02);
  }
  EXPECT_GT(emitted[0], 0);
}

INSTANTIATE_TEST_SUITE_P(, EditedLamps, testing::ValuesIn(lamp_cases()),
                         [](const auto& one) { return one.param.name; });

}  // namespace
}  // namespace candela::scene
