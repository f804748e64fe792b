// Claims, on random paths through every scene of tests/statistical/transport and gallery, and
// ../shared/scenes where it is there. The oracle is tests/unit/transport_reference.h: literal products
// in double.
// - The weights of the recursion (mis/balance_power.h), driven with the numbers of one path, are those of the
// literal
//   products, and over all techniques that can make the path they sum to one: both to 1e-12, for the balance
//   and the power heuristic, and the extended balance heuristic with merges of beams (mis/beam_balance.h),
//   any technique left out, eta from 1e-12 to 1e12.
// - The weights and values that the techniques return (technique/) are those of the oracle
//   for the path they made: weights to 1e-5, values to 1e-4, besides what floats are known to lose
//   (Evaluation::rounding). The oracle finds surfaces passed and lights by rays of its own, and its
//   directions differ in the last bit: one path in a thousand may differ more in its weight (narrow lobes),
//   one in fifty in its value (opacity and radiance from textures at places found anew), by at most what is
//   stated below.
// - So are those of technique/merge.h, where a light walk is made to end at the very place of an eye vertex,
// and of
//   TechniqueList for all four heuristics.
// - eta differs from place to place on the film: the weights of a path are those of eta where the path meets
// the
//   film, which the oracle finds from the path alone, whichever technique made the path.
// - All this holds on paths of a thousand vertices; where densities leave the range of doubles, weights stay
//   numbers.
// Deterministic: nothing is random but the paths, which have fixed seeds.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "common/description/object_list.h"
#include "common/edits/edits.h"
#include "tests/paths.h"
#include "tests/unit/scene_fixture.h"
#include "tests/unit/transport_path_test.h"
#include "worker/scene/edits/edit_request.h"

namespace candela::transport {
namespace {

namespace fs = std::filesystem;

template <EdgeContent kEdgeContent>
void run_all(const scene::Scene& scene, const WalkRules& rules, std::uint64_t pairs, Findings& findings) {
  PathTest<kEdgeContent, Balance> balance(scene, rules, findings);
  PathTest<kEdgeContent, Power> power(scene, rules, findings);
  if constexpr (kEdgeContent == EdgeContent::media) {
    PathTest<kEdgeContent, BeamBalance> beams(scene, rules, findings);
    for (std::uint64_t i = 0; i < pairs / 2; ++i) beams.run(i);
  }
  for (std::uint64_t i = 0; i < pairs; ++i) {
    if (i % 2 == 0)
      balance.run(i / 2);
    else
      power.run(i / 2);
  }
}

std::vector<fs::path> scene_files() {
  std::vector<fs::path> files;
  for (const char* folder : {"transport", "gallery"})
    for (const auto& entry : fs::directory_iterator(test::source_path("tests/statistical") / folder))
      // Its film has one pixel; the films of this test have more.
      if (entry.path().extension() == ".xml" && entry.path().stem() != "sensor-distant")
        files.push_back(entry.path());
  const fs::path shared = test::shared_path() / "scenes";
  if (fs::is_directory(shared))
    for (const auto& entry : fs::directory_iterator(shared))
      if (fs::exists(entry.path() / "scene.xml")) files.push_back(entry.path() / "scene.xml");
  std::sort(files.begin(), files.end());
  return files;
}

std::string label(const fs::path& file) {
  std::string text = file.stem() == "scene" ? file.parent_path().stem().string()
                                            : file.parent_path().stem().string() + "_" + file.stem().string();
  for (char& c : text)
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  return text;
}

double uniform(rng::Stream& stream) {
  return static_cast<double>(stream.next_float());
}

// The numbers of a path that no scene has: densities over `decades` orders of magnitude.
PathNumbers invented_path(rng::Stream& stream, std::size_t k, double decades) {
  const auto any = [&] { return std::pow(10.0, decades * (uniform(stream) - 0.5)); };
  PathNumbers n;
  n.edges = k;
  n.light_can_be_hit = uniform(stream) < 0.7;
  n.lens_can_be_hit = uniform(stream) < 0.7;
  n.light_prob = any();
  n.light_direct = any();
  n.lens_prob = any();
  n.lens_connect = n.lens_prob;
  for (std::size_t i = 0; i <= k; ++i) {
    const bool end = i == 0 || i == k;
    n.pdf_to_eye.push_back(any());
    n.pdf_to_light.push_back(any());
    n.factor_to_eye.push_back(end ? 1 : uniform(stream) + 1e-6);
    n.factor_to_light.push_back(end ? 1 : uniform(stream) + 1e-6);
    n.delta.push_back(!end && uniform(stream) < 0.3);
    n.in_medium.push_back(!end && !n.delta.back() && uniform(stream) < 0.3);
    // A medium's hazard is the same for both edges.
    n.medium.push_back(n.in_medium.back() ? static_cast<std::uint32_t>(i % 2) : scene::kNone);
    if (n.in_medium.back()) n.factor_to_light.back() = n.factor_to_eye.back();
    n.beam_sine.push_back(n.in_medium.back() && uniform(stream) < 0.8 ? uniform(stream) + 1e-6 : 0);
    if (i == k) break;
    n.survival.push_back(uniform(stream) + 1e-3);
    n.distance_squared.push_back(any());
  }
  return n;
}

template <class Heuristic>
void expect_recursion_holds(std::size_t k, double decades, std::uint64_t paths, bool finite_only = false) {
  for (std::uint64_t i = 0; i < paths; ++i) {
    rng::Stream stream(rng::key(17, i));
    const PathNumbers n = invented_path(stream, k, decades);
    const Counts counts = Heuristic::kMergesBeams ? beam_counts_of(i, true) : counts_of(i, true);
    const auto techniques = reference::list_techniques(n, counts);
    const auto weights = reference::weigh(techniques, kNamed<Heuristic>);
    const auto recursive = recursive_weights<Heuristic>(n, counts, techniques);
    double sum = 0;
    for (std::size_t t = 0; t < techniques.size(); ++t) {
      ASSERT_TRUE(recursive[t] >= 0 && recursive[t] <= 1) << recursive[t] << " path " << i;
      if (finite_only) continue;
      ASSERT_LE(std::abs(recursive[t] - weights[t]), 1e-9 * weights[t] + 1e-200) << "path " << i;
      sum += recursive[t];
    }
    const double expected = techniques.empty() || finite_only ? 0 : 1;
    ASSERT_LE(std::abs(sum - expected), 1e-9) << "path " << i;
  }
}

TEST(TransportWeights, HoldForAnyDensities) {
  for (const std::size_t k : {2u, 3u, 5u, 20u}) {
    expect_recursion_holds<Balance>(k, 8, 500);
    expect_recursion_holds<Power>(k, 8, 500);
    expect_recursion_holds<BeamBalance>(k, 8, 500);
  }
}

TEST(TransportWeights, HoldOnPathsOfAThousandVertices) {
  expect_recursion_holds<Balance>(1000, 1, 12);
  expect_recursion_holds<Power>(1000, 1, 12);
  expect_recursion_holds<BeamBalance>(1000, 1, 3);
  // Here the densities of techniques differ by more than doubles can say.
  expect_recursion_holds<Balance>(1000, 8, 60, true);
  expect_recursion_holds<Power>(1000, 8, 60, true);
}

class SceneWeights : public testing::TestWithParam<fs::path> {};

TEST_P(SceneWeights, AreThoseOfTheLiteralFormulas) {
  const auto scene = test::load_scene(GetParam());
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  const scene::SceneFeatures& features = (*scene)->features();
  WalkRules rules;
  rules.max_edges = 8;
  rules.rr_depth = 1u << 30;
  rules.meets_lens = features.finite_lens;
  rules.film_border = 1;
  rules.eye_paths = static_cast<double>(test::kFilmSize) * test::kFilmSize;
  Findings f;
  constexpr std::uint64_t kPairs = 400;
  if (features.media > 0)
    run_all<EdgeContent::media>(**scene, rules, kPairs, f);
  else if (features.any_passthrough)
    run_all<EdgeContent::surfaces>(**scene, rules, kPairs, f);
  else
    run_all<EdgeContent::nothing>(**scene, rules, kPairs, f);
  const std::string name = label(GetParam());
  std::printf("%zu paths, %zu lost; recursion %.1e, sum %.1e\n", f.paths, f.lost, f.largest_recursion_error,
              f.largest_sum_error);
  for (const auto& [what, errors] :
       {std::pair{"weights", &f.weight}, std::pair{"values", &f.value}, std::pair{"listed", &f.listed},
        std::pair{"merge weights", &f.merge_weight}, std::pair{"merge values", &f.merge_value}})
    std::printf("  %s: %zu, %zu loose, up to %.1e\n", what, errors->count, errors->loose, errors->largest);
  EXPECT_GE(f.paths, 200u);
  EXPECT_LE(f.lost, f.paths / 200);
  EXPECT_EQ(f.media_differ, 0u) << "a medium is another one from the light than from the eye";
  EXPECT_LE(f.largest_recursion_error, kOfRecursion);
  EXPECT_LE(f.largest_sum_error, kOfRecursion);
  // Narrow lobes make much of the last bits of a direction: of roughness 0.003, or refracted by 1.01.
  const bool narrow = name == "transport_near_delta" || name == "transport_index_matched";
  for (const Errors* weight : {&f.weight, &f.listed, &f.merge_weight}) {
    EXPECT_LE(weight->loose, 1 + weight->count * (narrow ? 50 : 1) / 1000) << weight->worst;
    EXPECT_LE(weight->largest, narrow ? 1e-2 : 5e-4) << weight->worst;
  }
  EXPECT_LE(f.merge_value.loose, 1 + f.merge_value.count / 1000) << f.merge_value.worst;
  EXPECT_LE(f.merge_value.largest, 1e-2) << f.merge_value.worst;
  EXPECT_LE(f.value.loose, 1 + f.value.count * 20 / 1000) << f.value.worst;
  EXPECT_LE(f.value.largest, 1e-2) << f.value.worst;
}

// Real walks of a thousand edges together, in a box and in a cloud that hardly absorb.
TEST(TransportWeights, HoldOnWalksOfAThousandEdges) {
  const std::string lamp =
      R"(<shape type="sphere"><point name="center" x="0" y="0.9" z="0"/><float name="radius" value="0.03"/>
         <emitter type="area"/></shape>)";
  const std::string box =
      R"(<shape type="cube"><bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.99"/></bsdf>
         </bsdf></shape>)";
  const std::string cloud =
      R"(<shape type="sphere"><float name="radius" value="40"/><bsdf type="null"/>
         <medium type="homogeneous" name="interior"><rgb name="sigma_t" value="3"/>
         <rgb name="albedo" value="0.99"/></medium></shape>)";
  scene::Scene::Options options;
  options.film_width = options.film_height = test::kFilmSize;
  for (const bool in_cloud : {false, true}) {
    const auto scene = test::build_scene(lamp + (in_cloud ? cloud : box), {}, "", options);
    ASSERT_TRUE(scene.ok()) << scene.error().to_string();
    WalkRules rules;
    rules.max_edges = 1000;
    rules.rr_depth = 1u << 30;
    rules.film_border = 1;
    Findings f;
    PathTest<EdgeContent::media, Balance> balance(**scene, rules, f, 165);
    PathTest<EdgeContent::media, Power> power(**scene, rules, f, 165);
    for (std::uint64_t i = 0; i < 3; ++i) {
      balance.run(i);
      power.run(i);
    }
    std::printf("%zu paths, recursion %.1e, sum %.1e; weights up to %.1e, listed up to %.1e\n", f.paths,
                f.largest_recursion_error, f.largest_sum_error, f.weight.largest, f.listed.largest);
    EXPECT_GE(f.paths, 50u);
    EXPECT_LE(f.largest_recursion_error, 1e-10);
    EXPECT_LE(f.largest_sum_error, 1e-10);
    EXPECT_LE(f.weight.largest, 1e-4) << f.weight.worst;
    EXPECT_LE(f.listed.largest, 1e-4) << f.listed.worst;
  }
}

// A scene with edits, in JSON.
Result<std::unique_ptr<scene::Scene>> edited_scene(const std::string& body, const std::string& edits) {
  scene::EditRequest request;
  CANDELA_ASSIGN(request.list, edits::parse_edits(edits));
  const test::TextFiles text({{"scene.xml", "<scene version=\"3.0.0\">" + body + "</scene>"}});
  CANDELA_ASSIGN(const auto described, description::parse_scene(text, "scene.xml", {}));
  const description::LetterObjects objects = description::letter_objects(*described.scene);
  request.names = objects.names;
  request.uses = objects.uses;
  scene::Scene::Options options;
  options.film_width = options.film_height = test::kFilmSize;
  options.edits = &request;
  return test::build_scene(body, {}, "", options);
}

template <EdgeContent kEdgeContent = EdgeContent::nothing>
void expect_literal_weights(const scene::Scene& scene, bool values) {
  WalkRules rules;
  rules.max_edges = 6;
  rules.rr_depth = 1u << 30;
  rules.film_border = 1;
  rules.eye_paths = static_cast<double>(test::kFilmSize) * test::kFilmSize;
  Findings f;
  run_all<kEdgeContent>(scene, rules, 400, f);
  std::printf("%zu paths; recursion %.1e, sum %.1e; weights up to %.1e, values up to %.1e\n", f.paths,
              f.largest_recursion_error, f.largest_sum_error, f.weight.largest, f.value.largest);
  EXPECT_GE(f.paths, 200u);
  EXPECT_LE(f.largest_recursion_error, kOfRecursion);
  EXPECT_LE(f.largest_sum_error, kOfRecursion);
  EXPECT_EQ(f.value.count > 0, values);
  for (const Errors* errors : {&f.weight, &f.listed, &f.merge_weight, &f.value, &f.merge_value})
    EXPECT_LE(errors->loose, 1 + errors->count * 20 / 1000) << errors->worst;
}

// Edits of light and of the eye, of surfaces that are rough, of one lobe of two, and behind a mirror: the
// oracle asks the edited bsdfs for values and densities of both walks, and products of them are the weights.
TEST(TransportWeights, HoldForEditedSurfaces) {
  const std::string body =
      R"(<shape type="sphere"><point name="center" x="0" y="0.8" z="0"/><float name="radius" value="0.15"/>
         <emitter type="area"/></shape>
         <shape type="cube" id="walls"><bsdf type="twosided"><bsdf type="roughplastic"><float name="alpha" value="0.25"/>
         <rgb name="diffuse_reflectance" value="0.7"/></bsdf></bsdf></shape>
         <shape type="sphere" id="glass"><point name="center" x="0.4" y="-0.5" z="0.2"/><float name="radius" value="0.3"/>
         <bsdf type="roughdielectric"><float name="alpha" value="0.3"/></bsdf></shape>
         <shape type="sphere"><point name="center" x="-0.5" y="-0.5" z="0"/><float name="radius" value="0.3"/>
         <bsdf type="conductor"/></shape>)";
  const auto scene = edited_scene(body, R"({"regions": {"low": {"sphere": [0, -1, 0, 0.7]}}, "edits": [
      {"name": "a", "direction": "light", "select": "LX*[DG]", "source": "low",
       "move": {"to": [0.5, -1, 0.4], "normal": [0, 1, 0], "stretch": [1.4, 1, 0.8]}},
      {"name": "b", "direction": "light", "select": "LX*G", "rotate": {"axis": [0.3, 1, 0.2], "degrees": 15}},
      {"name": "c", "direction": "eye", "select": "DX*E", "source": "low", "rotate": {"axis": [1, 0, 0], "degrees": 25},
       "tint": [1, 0.5, 0.8]}]})");
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  EXPECT_EQ((*scene)->features().edits.size(), 3u);
  expect_literal_weights(**scene, true);
}

// So it is with edits that select by the path, whose verdict a walk from one end does not know: both walks
// tell the densities that count the edits of all states, at each vertex for itself.
TEST(TransportWeights, HoldForEditsByThePath) {
  const std::string body =
      R"(<shape type="sphere"><point name="center" x="0" y="0.8" z="0"/><float name="radius" value="0.15"/>
         <emitter type="area"/></shape>
         <shape type="cube" id="walls"><bsdf type="twosided"><bsdf type="roughconductor"><float name="alpha" value="0.4"/>
         </bsdf></bsdf></shape>
         <shape type="sphere" id="ball"><point name="center" x="0.4" y="-0.5" z="0.2"/><float name="radius" value="0.3"/>
         <bsdf type="diffuse"/></shape>
         <shape type="sphere" id="glass"><point name="center" x="-0.5" y="-0.5" z="0"/><float name="radius" value="0.3"/>
         <bsdf type="roughdielectric"><float name="alpha" value="0.3"/></bsdf></shape>)";
  const auto scene = edited_scene(body, R"({"regions": {"low": {"sphere": [0, -1, 0, 0.7]}}, "edits": [
      {"name": "a", "direction": "light", "select": "LX{walls}X", "source": "low",
       "move": {"to": [0.5, -1, 0.4], "normal": [0, 1, 0], "stretch": [1.4, 1, 0.8]}},
      {"name": "b", "direction": "light", "select": "LX*X{ball}X{walls}", "rotate": {"axis": [0.3, 1, 0.2], "degrees": 15}},
      {"name": "c", "direction": "eye", "select": "X{walls}X{ball}X*E", "source": "low",
       "rotate": {"axis": [1, 0, 0], "degrees": 25}, "tint": [1, 0.5, 0.8]}]})");
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  ASSERT_NE((*scene)->objects().path_edits, nullptr);
  expect_literal_weights(**scene, false);
}

// So it is with edits of lamps, of surfaces and of a medium at once, of the vertex alone and by the path.
TEST(TransportWeights, HoldForEditedLampsAndMedia) {
  const std::string body =
      R"(<shape type="sphere" id="lamp"><point name="center" x="0" y="0.8" z="0"/><float name="radius" value="0.15"/>
         <emitter type="area"/></shape>
         <emitter type="spot" id="spot"><transform name="to_world"><lookat origin="-0.6, 0.6, 0.3" target="0, -0.5, 0"
         up="0, 0, 1"/></transform></emitter>
         <shape type="cube" id="walls"><bsdf type="twosided"><bsdf type="diffuse"/></bsdf>
         <medium type="homogeneous" name="interior" id="fog"><rgb name="sigma_t" value="0.8"/>
         <rgb name="albedo" value="0.9"/><phase type="hg"><float name="g" value="0.4"/></phase></medium></shape>)";
  const std::string lamps = R"({"regions": {"low": {"sphere": [0, -1, 0, 0.7]}}, "edits": [
      {"name": "a", "direction": "light", "select": "L{lamp}", "source": "low",
       "move": {"to": [0.5, -1, 0.4], "normal": [0, 1, 0], "stretch": [1.4, 1, 0.8]}},
      {"name": "b", "direction": "light", "select": "L", "rotate": {"axis": [0.3, 1, 0.2], "degrees": 15}},)";
  const auto by_vertex = edited_scene(
      body, lamps + R"({"name": "c", "direction": "light", "select": "L[XV]*[XV]", "source": "low",
       "move": {"to": [0.5, -1, 0.4], "stretch": [1.4, 1, 0.8]}},
      {"name": "d", "direction": "eye", "select": "V[XV]*E", "rotate": {"axis": [1, 0, 0], "degrees": 25},
       "tint": [1, 0.5, 0.8]}]})");
  ASSERT_TRUE(by_vertex.ok()) << by_vertex.error().to_string();
  ASSERT_EQ((*by_vertex)->objects().path_edits, nullptr);
  expect_literal_weights<EdgeContent::media>(**by_vertex, true);
  const auto by_path =
      edited_scene(body, lamps + R"({"name": "c", "direction": "light", "select": "L[XV]V", "source": "low",
       "move": {"to": [0.5, -1, 0.4], "stretch": [1.4, 1, 0.8]}},
      {"name": "d", "direction": "eye", "select": "VXE", "rotate": {"axis": [1, 0, 0], "degrees": 25}}]})");
  ASSERT_TRUE(by_path.ok()) << by_path.error().to_string();
  ASSERT_NE((*by_path)->objects().path_edits, nullptr);
  expect_literal_weights<EdgeContent::media>(**by_path, false);
}

// No scene of the folders has a lens of finite size in a medium.
TEST(TransportWeights, HoldForALensInFog) {
  const std::string sensor =
      R"(<sensor type="thinlens"><float name="fov" value="100"/><float name="aperture_radius" value="1"/>
         <float name="focus_distance" value="3"/></sensor>)";
  const std::string body =
      R"(<shape type="sphere"><float name="radius" value="6"/><bsdf type="null"/>
         <medium type="homogeneous" name="interior"><rgb name="sigma_t" value="0.2 0.4 0.8"/>
         <rgb name="albedo" value="0.9"/></medium></shape>
         <shape type="rectangle"><transform name="to_world"><rotate y="1" angle="180"/><scale value="2"/>
         <translate z="3"/></transform></shape>
         <shape type="sphere"><point name="center" x="1" y="1" z="2"/><float name="radius" value="0.4"/>
         <emitter type="area"/></shape>)";
  scene::Scene::Options options;
  options.film_width = options.film_height = test::kFilmSize;
  const auto scene = test::build_scene(body, {}, sensor, options);
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  WalkRules rules;
  rules.max_edges = 6;
  rules.rr_depth = 1u << 30;
  rules.meets_lens = true;
  rules.film_border = 1;
  rules.eye_paths = 4096;
  Findings f;
  run_all<EdgeContent::media>(**scene, rules, 4000, f);
  std::printf("%zu paths, %zu of them met the lens; weights up to %.1e, values up to %.1e\n", f.paths,
              f.met_lens, f.weight.largest, f.value.largest);
  EXPECT_GE(f.met_lens, 30u);
  EXPECT_LE(f.lost, f.paths / 200);
  EXPECT_LE(f.largest_recursion_error, kOfRecursion);
  EXPECT_LE(f.weight.largest, 1e-4) << f.weight.worst;
  EXPECT_LE(f.listed.largest, 1e-4) << f.listed.worst;
  EXPECT_LE(f.value.largest, 1e-4) << f.value.worst;
}

INSTANTIATE_TEST_SUITE_P(Scenes, SceneWeights, testing::ValuesIn(scene_files()),
                         [](const auto& test) { return label(test.param); });

}  // namespace
}  // namespace candela::transport
