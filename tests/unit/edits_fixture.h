// Edited closures at one hit, and the definition of an edit: a walk that turns what the bsdf scatters, and
// leaves all else. The definition here is code of its own, and knows neither branches nor Jacobians.
//
// The tests that the retargeting note asks for (section 13), by its numbers; planted bugs are the mutants
// "edit*" and "path-edit*" (tests/mutants/mutants.toml):
//   1  maps              DirectionMaps
//   2  path by path      EditedClosures.DrawWhatTheyTell, .AreOneBsdfInBothModes; EditedPhases; EditedLamps
//   3  densities         EditedClosures.DrawWhatTheyTell, EditedPhases.DrawWhatTheyTell, EditedLamps
//   4  branches          EditBranches, EditedClosures.ScatterWhatTheDefinitionTurns
//   5  alternatives      EditedClosures.DrawWhatTheyTell; lobes: EditRenderers.ChangeTheLobesThatTheySelect
//   6  delta vertices    EditedDeltaLobes, EditedLobes (tests/statistical/test_edits.cpp)
//   7  prefix            EditedWalks, EditedPrefix, EditTable (prefix_*; test_edits_table.cpp)
//   8  every integrator  EditedLight, EditedByPath, EditedShadingNormals (test_edits.cpp), EditedPlaces
//                        (test_edits_places.cpp), EditTable; EditRenderers.ScaleWithTheScene,
//                        .ActFarFromTheOrigin
//   9  energy            EditedBox (test_edits_energy.cpp), EditedFurnace (test_edits.cpp)
//   10 identity          EditText.LosesWhatChangesNothing, EditRenderers.KeepBitsOfWhatChangesNothing; the
//                        guard of instructions (tests/bench/guard.py)
//   11 weights           TransportWeights.HoldForEdited* and .HoldForEditsByThePath
//   12 refusals          EditRenderers.RefuseByName, EditText.*, EditSelection.*; fuzz: LettersRequest.Fuzz,
//                        EditText.SurvivesRandomChanges, EditRenderers.SurviveRandomEdits
//   13 automata          LettersAutomaton, EditStates
//   14 layers            Layers, EditedLayers, LayersOf (tests/statistical/test_letters.cpp),
//   tests/farm/test_layers.cpp
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "common/edits/edits.h"
#include "scene_fixture.h"
#include "worker/scene/bsdfs/bsdf_build.h"
#include "worker/transport/vertex.h"

namespace candela::scene {

inline constexpr TransportMode kRadiance = TransportMode::radiance, kImportance = TransportMode::importance;

// ---- the scene: one hit, one bsdf, some edits ----

struct Edited {
  test::TextFiles files{{}};
  TextureStore textures{files};
  std::vector<Bsdf> bsdfs;
  SceneEdits scene;
  edits::EditList list;
  SurfaceHit hit;
};

struct Case {
  std::string name, bsdf, edits;  // edits: what is in the list, in JSON
  bool bumpy = false;             // the shading normal is not the geometric one
  // Lobes that are edited.
  bool diffuse = true, glossy = true, delta = true;
  friend void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }
};

inline std::unique_ptr<Edited> make(const Case& c) {
  auto e = std::make_unique<Edited>();
  const test::TextFiles text(
      {{"scene.xml", fmt::format("<scene version='3.0.0'><sensor type='perspective'/><shape "
                                 "type='sphere'>{}</shape></scene>",
                                 c.bsdf)}});
  const auto parsed = description::parse_scene(text, "scene.xml", {});
  EXPECT_TRUE(parsed.ok());
  auto built = Bsdf::build(*parsed->scene->children_of("shape")[0]->children_of("bsdf").at(0), e->textures);
  EXPECT_TRUE(built.ok());
  e->bsdfs.push_back(*std::move(built));
  const auto list = edits::parse_edits(R"({"regions": {"up": {"sphere": [1.2, 0.4, 1.1, 0.6]},
      "side": {"box": [-2, -1, 0.3, -0.7, 1, 1.5]}}, "edits": [)" +
                                       c.edits + "]}");
  EXPECT_TRUE(list.ok()) << list.error().to_string();
  e->list = *list;
  for (const edits::Edit& edit : e->list.edits)
    e->scene.edits.push_back(
        {.of_light = edit.direction == edits::Edit::Direction::light,
         .map = direction_map(edit),
         .cone = cone_of(e->list, edit),
         .factor = {static_cast<float>(edit.factor[0]), static_cast<float>(edit.factor[1]),
                    static_cast<float>(edit.factor[2])}});
  SurfaceEdits surface;
  surface.scene = &e->scene;
  surface.by_regions.resize(1);
  const std::array<bool, 3> takes = {c.diffuse, c.glossy, c.delta};
  for (std::size_t lobe = 0; lobe < 3; ++lobe)
    for (std::size_t side = 0; side < 2; ++side)
      for (std::size_t k = 0; takes[lobe] && k < e->scene.edits.size(); ++k) {
        auto& t = surface.by_regions[0][lobe][side];
        (e->scene.edits[k].of_light ? t.of_light : t.of_eye) |= static_cast<std::uint16_t>(1u << k);
      }
  auto edited = Bsdf::with_edits(e->bsdfs, 0, std::move(surface));
  EXPECT_TRUE(edited.ok());
  e->bsdfs.push_back(*std::move(edited));
  const Vec3 n = normalize(Vec3{0.1f, -0.2f, 1});
  e->hit.shading = make_frame(n);
  e->hit.ng = c.bumpy ? normalize(Vec3{0.35f, -0.2f, 1}) : n;
  e->hit.p = {0.1f, 0.2f, -0.1f};
  // The scene was moved: places of the file are these, and the offset.
  e->scene.offset = {0, 0, 0};
  return e;
}

struct At {
  const Edited& e;
  ClosureArena arena, plain_arena;
  Closure edited, plain;
  At(const Edited& scene, Vec3 wo) : e(scene) {
    e.bsdfs[1].prepare(e.hit, wo, arena, edited);
    e.bsdfs[0].prepare(e.hit, wo, plain_arena, plain);
  }
  // With the correction for shading normals.
  Spectrum value(const Closure& closure, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf) const {
    const Spectrum v = closure.eval_pdf(wo, wi, mode, pdf);
    return mode == kRadiance ? v : v * correction(wo, wi);
  }
  float correction(Vec3 wo, Vec3 wi) const {
    return transport::shading_correction(e.hit, e.hit.shading.to_world(wo), e.hit.shading.to_world(wi));
  }
  double geometric(Vec3 w) const {
    return std::abs(static_cast<double>(dot(e.hit.shading.to_world(w), e.hit.ng)));
  }
};

// ---- the definition ----

// Sends w through all edits of one direction, in order, and gathers their factors. False: it is lost.
inline bool sent(const Edited& e, bool of_light, Vec3 local, Vec3& out, Spectrum& factor) {
  Vec3d w(e.hit.shading.to_world(local));
  const Vec3d x = Vec3d(e.hit.p) + e.scene.offset, g(e.hit.ng), s(e.hit.shading.n);
  for (std::size_t k = 0; k < e.list.edits.size(); ++k) {
    const edits::Edit& edit = e.list.edits[k];
    if ((edit.direction == edits::Edit::Direction::light) != of_light) continue;
    if (!contains(cone_of(e.list, edit), x, normalize(w))) continue;
    Vec3d o = w;
    if (edit.rotate) {
      const Vec3d axis{edit.rotate->axis[0], edit.rotate->axis[1], edit.rotate->axis[2]},
          u = axis / length(axis);
      const double a = edit.rotate->degrees * std::numbers::pi / 180;
      o = w * std::cos(a) + cross(u, w) * std::sin(a) + u * (dot(u, w) * (1 - std::cos(a)));
    } else if (edit.move) {
      const auto vec = [](const edits::Triple& v) { return Vec3d{v[0], v[1], v[2]}; };
      const Vec3d from = vec(edit.move->from), m = edit.move->normal ? vec(*edit.move->normal) : from - x;
      const double t = dot(m, from - x) / dot(m, w);
      const Vec3d y = x + w * t - from;
      const auto& l = edit.move->linear;
      const Vec3d image = vec(edit.move->to) + Vec3d{l[0] * y.x + l[1] * y.y + l[2] * y.z,
                                                     l[3] * y.x + l[4] * y.y + l[5] * y.z,
                                                     l[6] * y.x + l[7] * y.y + l[8] * y.z};
      o = normalize(image - x) * (t < 0 ? -1.0 : 1.0);
    }
    if (!(dot(o, g) * dot(w, g) > 0) || !(dot(o, s) * dot(w, s) > 0)) return false;
    factor *= Spectrum(static_cast<float>(edit.factor[0]), static_cast<float>(edit.factor[1]),
                       static_cast<float>(edit.factor[2]));
    w = o;
  }
  out = e.hit.shading.to_local(Vec3(w));
  return true;
}

// Things to integrate against: local in direction, so that light at the wrong place is told from no light.
inline constexpr int kTests = 4;
inline std::array<double, kTests> tests_of(Vec3 w) {
  const auto bump = [&](Vec3 a) { return std::exp(6.0 * (static_cast<double>(dot(w, normalize(a))) - 1)); };
  return {1, bump({1, 0.3f, 1}), bump({-1, 0.2f, 0.6f}), bump({0.2f, -1, -0.7f})};
}

struct Sums {
  std::array<double, kTests> value{};
  double pdf = 0, lost = 0;
  void add(Vec3 w, double v, double p, double area) {
    const auto t = tests_of(w);
    for (int i = 0; i < kTests; ++i)
      value[static_cast<std::size_t>(i)] += v * t[static_cast<std::size_t>(i)] * area;
    pdf += p * area;
  }
};

// Over the sphere, by midpoints; fine enough for lobes of alpha 0.3 and the rims of cones. The poles, whose
// cells are long, lie in the surface.
inline void over_sphere(const std::function<void(Vec3, double)>& visit) {
  constexpr int kRows = 200, kColumns = 240;
  for (int r = 0; r < kRows; ++r)
    for (int c = 0; c < kColumns; ++c) {
      const double z = -1 + (2 * r + 1.0) / kRows, phi = 2 * std::numbers::pi * (c + 0.5) / kColumns,
                   s = std::sqrt(1 - z * z);
      visit(Vec3(Vec3d{z, s * std::cos(phi), s * std::sin(phi)}), 4 * std::numbers::pi / (kRows * kColumns));
    }
}

inline const std::string kDiffuse =
    "<bsdf type='twosided'><bsdf type='diffuse'><rgb name='reflectance' value='0.8'/></bsdf></bsdf>";
inline const std::string kRough = "<bsdf type='roughconductor'><float name='alpha' value='0.35'/></bsdf>";
inline const std::string kPlastic =
    "<bsdf type='roughplastic'><float name='alpha' value='0.25'/><rgb name='diffuse_reflectance' "
    "value='0.6'/></bsdf>";
inline const std::string kGlass = "<bsdf type='roughdielectric'><float name='alpha' value='0.4'/></bsdf>";

inline const std::string kTurn =
    R"({"name": "turn", "direction": "light", "select": "LX*X", "rotate": {"axis": [1, 2, 0.5], "degrees": 25}})";
inline const std::string kMove =
    R"({"name": "move", "direction": "light", "select": "LX*X", "move": {"from": [0.5, 0.2, 1.5], "to": [0.2, 0.9, 1.1],
        "linear": [1.4, 0.2, 0, 0, 0.7, 0.1, 0, 0, 1], "normal": [0.1, 0, 1]}})";
inline const std::string kHighlight =
    R"({"name": "highlight", "direction": "light", "select": "LX*X", "source": "up", "move": {"to": [-0.9, 0.2, 1.2],
        "stretch": [1.5, 0.8, 1]}})";
inline const std::string kSecond =
    R"({"name": "second", "direction": "light", "select": "LX*X", "source": "side", "rotate": {"axis": [0, 0, 1],
        "degrees": 70}, "tint": [0.5, 1, 1]})";
inline const std::string kGather =
    R"({"name": "gather", "direction": "eye", "select": "XX*E", "source": "side", "move": {"to": [1, -0.6, 1.2],
        "normal": [1, 0, 0.4]}})";
inline const std::string kTint =
    R"({"name": "tint", "direction": "light", "select": "LX*X", "source": "up", "scale": 0.25})";

inline const std::vector<Case>& cases() {
  static const std::vector<Case> all = {
      {"rotation", kDiffuse, kTurn},
      {"rotation_bumpy", kRough, kTurn, true},
      {"affine", kRough, kMove},
      {"affine_bumpy", kDiffuse, kMove, true},
      {"highlight", kRough, kHighlight},
      {"highlight_bumpy", kRough, kHighlight, true},
      {"sequence", kDiffuse, kHighlight + "," + kSecond},
      {"sequence_back", kDiffuse, kSecond + "," + kHighlight},
      {"gather", kRough, kGather},
      {"gather_bumpy", kPlastic, kGather, true},
      {"both", kDiffuse, kHighlight + "," + kGather},
      {"both_bumpy", kRough, kGather + "," + kMove, true},
      {"tint", kPlastic, kTint},
      {"glossy_alone", kPlastic, kHighlight, false, false, true},
      {"diffuse_alone", kPlastic, kTurn, false, true, false},
      {"glossy_gathers", kPlastic, kGather, true, false, true},
      {"glossy_both", kPlastic, kMove + "," + kGather, false, false, true},
      {"rough_glass", kGlass, kTurn},
  };
  return all;
}
inline std::vector<Vec3> directions_from() {
  return {normalize(Vec3{0.3f, -0.2f, 1}), normalize(Vec3{-0.9f, 0.6f, 0.45f})};
}

}  // namespace candela::scene
