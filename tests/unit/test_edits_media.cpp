// Places in media whose light edits turn (edited_phase(), worker/scene/bsdfs/edited.h), against the
// definition of an edit: the phase function, each direction sent where the edits send it. No direction is
// lost.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "chi_squared.h"
#include "common/rng/stream.h"
#include "edits_fixture.h"

namespace candela::scene {
namespace {

struct PhaseCase {
  std::string name;
  float g;
  std::string edits;
  friend void PrintTo(const PhaseCase& c, std::ostream* out) { *out << c.name; }
};
const std::vector<PhaseCase>& phase_cases() {
  static const std::vector<PhaseCase> all = {
      {"rotation", 0.6f, kTurn},
      {"affine", 0.3f, kMove},
      {"sequence", 0, kHighlight + "," + kSecond},
      {"sequence_back", 0.6f, kSecond + "," + kHighlight},
      {"gather", 0.5f, kGather},
      {"both", -0.4f, kHighlight + "," + kGather},
      {"tint", 0.2f, kTint},
  };
  return all;
}

// A place in a medium, and its closure.
struct InFog {
  Phase phase;
  edits::EditList list;
  SceneEdits scene;
  SurfaceEdits edits;
  ClosureArena arena;
  Closure closure;
  Vec3 p{0.1f, 0.2f, -0.1f};

  explicit InFog(const PhaseCase& c) : phase(Phase::henyey_greenstein(c.g)) {
    list = *edits::parse_edits(R"({"regions": {"up": {"sphere": [1.2, 0.4, 1.1, 0.6]},
        "side": {"box": [-2, -1, 0.3, -0.7, 1, 1.5]}}, "edits": [)" +
                               c.edits + "]}");
    SurfaceEdits::Treatment all;
    for (std::size_t k = 0; k < list.edits.size(); ++k) {
      const edits::Edit& edit = list.edits[k];
      const bool of_light = edit.direction == edits::Edit::Direction::light;
      scene.edits.push_back(
          {.of_light = of_light,
           .map = direction_map(edit),
           .cone = cone_of(list, edit),
           .factor = {static_cast<float>(edit.factor[0]), static_cast<float>(edit.factor[1]),
                      static_cast<float>(edit.factor[2])}});
      (of_light ? all.of_light : all.of_eye) |= static_cast<std::uint16_t>(1u << k);
    }
    edits.scene = &scene;
    edits.by_regions.resize(1);
    for (auto& sides : edits.by_regions[0]) sides.fill(all);
    EXPECT_TRUE(edited_phase(edits, phase, p, arena, closure));
  }
  Vec3 sent(bool of_light, Vec3 along, float& factor) const {
    Vec3d w(along);
    for (const edits::Edit& edit : list.edits) {
      if ((edit.direction == edits::Edit::Direction::light) != of_light) continue;
      if (!contains(cone_of(list, edit), Vec3d(p), w)) continue;
      factor *= static_cast<float>(edit.factor[0]);
      const DirectionMap map = direction_map(edit);
      MapAtVertex at;
      if (map.turns && at.set(map, Vec3d(p))) w = at.forward(w);
    }
    return Vec3(w);
  }
};

class EditedPhases : public testing::TestWithParam<PhaseCase> {};

// Claim: a place scatters what its phase function does, turned direction by direction, into every direction
// that a walk may have come from; and nothing is lost.
TEST_P(EditedPhases, ScatterWhatTheDefinitionTurns) {
  const InFog at(GetParam());
  bool tinted = false;
  for (const auto& edit : at.list.edits) tinted |= edit.factor[0] != 1;
  for (const bool of_light : {true, false}) {
    bool only = true;
    for (const auto& edit : at.scene.edits) only &= edit.of_light == of_light;
    if (!only) continue;  // both kinds at once: the next test
    const TransportMode mode = of_light ? kImportance : kRadiance;
    for (const Vec3 wo : directions_from()) {
      Sums turned, edited;
      over_sphere([&](Vec3 w, double area) {
        float pdf = 0;
        const Spectrum v = at.closure.eval_pdf(wo, w, mode, pdf);
        edited.add(w, static_cast<double>(v.r), static_cast<double>(pdf), area);
        float factor = 1;
        const Vec3 o = at.sent(of_light, w, factor);
        turned.add(o, static_cast<double>(at.phase.eval(wo, w) * factor), 0, area);
      });
      for (std::size_t i = 0; i < kTests; ++i)
        EXPECT_NEAR(edited.value[i], turned.value[i], 0.006 + 0.01 * turned.value[i]) << i;
      EXPECT_NEAR(edited.pdf, 1, 0.01);
      if (!tinted) {
        EXPECT_NEAR(edited.value[0], 1, 0.01);
      }
    }
  }
}

// Claim: walks from the eye and from the light see one function.
TEST_P(EditedPhases, AreOneInBothModes) {
  const InFog at(GetParam());
  rng::Stream stream(rng::key(21));
  for (int i = 0; i < 2000; ++i) {
    const Vec3 o = test::uniform_direction(stream), l = test::uniform_direction(stream);
    float pdf = 0;
    const float a = at.closure.eval_pdf(o, l, kRadiance, pdf).g,
                b = at.closure.eval_pdf(l, o, kImportance, pdf).g;
    EXPECT_NEAR(a, b, 2e-3f * (a + b) + 1e-6f) << i;
  }
}

// Claim: samples have the density that is told, in both modes, and weights that bring the value. Fails by
// chance with probability below 1e-6 for each of the 28 tests of cells.
TEST_P(EditedPhases, DrawWhatTheyTell) {
  const InFog at(GetParam());
  constexpr std::size_t kRows = 10, kColumns = 12;
  const auto cell_of = [](Vec3 w) {
    const auto part = [](double x, std::size_t count) {
      return std::min(static_cast<std::size_t>(std::max(0.0, x * static_cast<double>(count))), count - 1);
    };
    const double turn =
        std::atan2(static_cast<double>(w.z), static_cast<double>(w.y)) / (2 * std::numbers::pi);
    return part((static_cast<double>(w.x) + 1) / 2, kRows) * kColumns +
           part(turn < 0 ? turn + 1 : turn, kColumns);
  };
  constexpr int kSamples = 8000;
  for (const TransportMode mode : {kRadiance, kImportance})
    for (const Vec3 wo : directions_from()) {
      std::vector<double> expected(kRows * kColumns + 1), observed(kRows * kColumns + 1);
      double whole = 0;
      over_sphere([&](Vec3 w, double area) {
        const double p = static_cast<double>(at.closure.pdf_solid_angle(wo, w, mode)) * area;
        expected[cell_of(w)] += p * kSamples;
        whole += p;
      });
      expected.back() = std::max(0.0, 1 - whole) * kSamples;
      rng::Stream stream(rng::key(31));
      for (int i = 0; i < kSamples; ++i) {
        const float u_lobe = stream.next_float(), u = stream.next_float(), v = stream.next_float();
        BsdfSample s;
        if (!at.closure.sample(wo, u_lobe, {u, v}, mode, s)) {
          observed.back() += 1;
          continue;
        }
        observed[cell_of(s.wi)] += 1;
        float pdf = 0;
        const Spectrum value = at.closure.eval_pdf(wo, s.wi, mode, pdf);
        EXPECT_NEAR(pdf / s.pdf_solid_angle, 1, 2e-3);
        EXPECT_NEAR(s.weight.r * s.pdf_solid_angle, value.r, 4e-3f * value.r + 1e-5f);
      }
      EXPECT_GT(test::chi_squared_p(observed, expected), 1e-6) << static_cast<int>(mode);
    }
}

INSTANTIATE_TEST_SUITE_P(, EditedPhases, testing::ValuesIn(phase_cases()),
                         [](const auto& one) { return one.param.name; });

// Claim: where no edit of the region takes part there is no closure, and the phase function is asked.
TEST(EditedPhase, IsPlainBesideItsRegion) {
  SceneEdits scene;
  scene.edits.resize(1);
  scene.edits[0].map.turns = false;
  Cone region;
  region.everywhere = false;
  region.sphere = true;
  region.radius = 1;
  scene.regions = {region};
  SurfaceEdits edits;
  edits.scene = &scene;
  edits.by_regions.resize(2);
  for (auto& sides : edits.by_regions[1]) sides.fill({1, 0});
  const Phase phase;
  ClosureArena arena;
  Closure closure;
  EXPECT_TRUE(edited_phase(edits, phase, {0.5f, 0, 0}, arena, closure));
  EXPECT_FALSE(edited_phase(edits, phase, {1.5f, 0, 0}, arena, closure));
}

}  // namespace
}  // namespace candela::scene
