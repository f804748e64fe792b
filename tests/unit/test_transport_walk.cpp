// Walks from the light that meet the lens.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>

#include "tests/unit/scene_fixture.h"
#include "worker/transport/walk.h"

namespace candela::transport {
namespace {

// A lens that looks at a wall, with a wall behind it and a lamp beside.
const std::string kWallAndLamp =
    "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"3\"/><translate z=\"-1\"/>"
    "</transform></shape>"
    "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"3\"/>"
    "<rotate y=\"1\" angle=\"180\"/><translate z=\"2\"/></transform></shape>"
    "<shape type=\"sphere\"><point name=\"center\" x=\"1.5\" y=\"0\" z=\"1.2\"/><float name=\"radius\" "
    "value=\"0.2\"/><emitter type=\"area\"><rgb name=\"radiance\" value=\"1\"/></emitter></shape>";
// Between wall and lens; light passes it straight.
const std::string kSheet =
    "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"4\"/><translate z=\"0.5\"/>"
    "</transform><bsdf type=\"null\"/></shape>";
const std::string kLens =
    "<sensor type=\"thinlens\"><float name=\"fov\" value=\"60\"/><float name=\"aperture_radius\" "
    "value=\"0.5\"/><float name=\"focus_distance\" value=\"2\"/></sensor>";

// How many of `walks` meet the lens with their edge number max_edges + 1, which is there for that alone.
template <Between kBetween>
int last_edge_meetings(const std::string& body, std::uint32_t max_edges, int walks) {
  const auto scene = test::build_scene(body, {}, kLens);
  EXPECT_TRUE(scene.ok()) << scene.error().to_string();
  if (!scene.ok()) return 0;
  WalkRules rules;
  rules.max_edges = max_edges;
  rules.rr_depth = 1u << 30;
  rules.meets_lens = true;
  rules.eye_paths = 64 * 64;
  const MisFactors factors{1, 1, 1, 1, 1};
  film::Tallies tallies;
  samplers::Sampler sampler(samplers::SamplerKind::independent, 5);
  int meetings = 0;
  Vertex v;
  scene::ClosureArena arena;
  for (int i = 0; i < walks; ++i) {
    sampler.start_light(0, 0, static_cast<std::uint64_t>(i));
    using LightWalk = Walk<scene::TransportMode::importance, kBetween, Balance>;
    LightWalk walk(**scene, rules, factors, sampler, tallies);
    if (!walk.start_light()) continue;
    for (;;) {
      const auto event = walk.advance(v, arena);
      EXPECT_LE(walk.lens().met ? walk.lens().edges : 0, max_edges + 1);
      meetings += walk.lens().met && walk.lens().edges == max_edges + 1 ? 1 : 0;
      if (event != LightWalk::Event::vertex) break;
      EXPECT_TRUE(v.edges <= max_edges || !v.connects);
      if (walk.scatter(v) == LightWalk::Step::ended) break;
    }
  }
  return meetings;
}

// Claim: a sheet that light passes straight takes no light from the lens, with the last edge either. Twice
// the same number is expected; 5 standard deviations: false alarm 6e-7.
TEST(LightWalk, MeetsTheLensStraightThroughASheetWithItsLastEdge) {
  constexpr int kWalks = 200000;
  for (const std::uint32_t max_edges : {1u, 2u}) {
    const int open = last_edge_meetings<Between::surfaces>(kWallAndLamp, max_edges, kWalks);
    const int through = last_edge_meetings<Between::surfaces>(kWallAndLamp + kSheet, max_edges, kWalks);
    const int media = last_edge_meetings<Between::media>(kWallAndLamp + kSheet, max_edges, kWalks);
    EXPECT_GT(open, 100) << max_edges;
    EXPECT_NEAR(through, open, 5 * std::sqrt(open + through)) << max_edges;
    EXPECT_NEAR(media, open, 5 * std::sqrt(open + media)) << max_edges;
  }
}

}  // namespace
}  // namespace candela::transport
