// Connections of vertices between which the media alone tell that a surface stands.
#include <gtest/gtest.h>

#include <cstdio>
#include <string>
#include <vector>

#include "tests/unit/scene_fixture.h"
#include "worker/transport/eye_path.h"
#include "worker/transport/light_path.h"
#include "worker/transport/technique/connect.h"
#include "worker/transport/technique/connect_lens.h"
#include "worker/transport/technique/next_event.h"

namespace candela::transport {
namespace {

using LightWalk = Walk<TransportMode::importance, EdgeContent::media, Balance>;
using EyeWalk = Walk<TransportMode::radiance, EdgeContent::media, Balance>;

// Smoke of two kinds in a ball of rough glass and a smooth one inside it, over a rough floor in thin fog.
const std::string kBalls = R"(
  <medium id="fog" type="homogeneous"><rgb name="sigma_t" value="0.1, 0.2, 0.3"/><rgb name="albedo" value="0.9"/></medium>
  <medium id="smoke" type="homogeneous"><rgb name="sigma_t" value="2"/><rgb name="albedo" value="0.9"/></medium>
  <medium id="ink" type="homogeneous"><rgb name="sigma_t" value="4"/><rgb name="albedo" value="0.5"/></medium>
  <shape type="rectangle"><transform name="to_world"><scale value="5"/><translate z="-1"/></transform></shape>
  <shape type="sphere"><float name="radius" value="0.9"/><bsdf type="roughdielectric"><float name="alpha" value="0.3"/></bsdf>
    <ref id="smoke" name="interior"/><ref id="fog" name="exterior"/></shape>
  <shape type="sphere"><float name="radius" value="0.4"/><bsdf type="dielectric"/>
    <ref id="ink" name="interior"/><ref id="smoke" name="exterior"/></shape>
  <shape type="sphere"><point name="center" x="2" y="0" z="2"/><float name="radius" value="0.3"/>
    <emitter type="area"><rgb name="radiance" value="5"/></emitter><ref id="fog" name="exterior"/></shape>
  <shape type="sphere"><float name="radius" value="9"/><bsdf type="diffuse"/><ref id="fog" name="interior"/></shape>)";
const std::string kCamera = R"(<sensor type="perspective"><float name="fov" value="40"/>
  <transform name="to_world"><lookat origin="0, -4, 1" target="0, 0, 0" up="0, 0, 1"/></transform></sensor>)";

// The techniques at each eye vertex, with the light path at hand, by both contexts.
struct BothWays {
  const ConnectContext& media_tell;
  const ConnectContext& all_traced;
  const Subpath<MisBlock>& light;
  std::vector<std::uint32_t> made = std::vector<std::uint32_t>(2, 0);  // by whether they bring something

  void expect_same(bool found, const Contribution& a, bool again, const Contribution& b) {
    ASSERT_EQ(found, again);
    ++made[found ? 1 : 0];
    if (!found) return;
    EXPECT_TRUE(a.value.r == b.value.r && a.value.g == b.value.g && a.value.b == b.value.b);
    EXPECT_EQ(a.weight, b.weight);
  }
  void arrived(const EyeWalk& /*walk*/, const Vertex<MisBlock>& /*v*/, const Vertex<MisBlock>* /*before*/,
               bool /*left*/) {}
  bool vertex(const EyeWalk& walk, const Vertex<MisBlock>& y) {
    if (!y.connectible) return true;
    const MergeFactors eta;
    Contribution a, b;
    bool found = next_event<EdgeContent::media, Balance>(media_tell, walk.draws(), y, eta, a);
    expect_same(found, a, next_event<EdgeContent::media, Balance>(all_traced, walk.draws(), y, eta, b), b);
    for (std::uint32_t i = 0; i < light.size(); ++i) {
      if (!light[i].connectible) continue;
      found = connect<EdgeContent::media, Balance>(media_tell, light[i], y, i, eta, a);
      expect_same(found, a, connect<EdgeContent::media, Balance>(all_traced, light[i], y, i, eta, b), b);
    }
    return true;
  }
  void passed() {}
  template <class WalkT>
  static bool scattered(const WalkT& /*walk*/, const Vertex<MisBlock>& /*v*/) {
    return true;
  }
};
struct Keeper {
  static void met_lens(const LightWalk& /*walk*/, std::uint64_t /*key*/) {}
  static bool vertex(const LightWalk& /*walk*/, const Vertex<MisBlock>& /*v*/, std::uint64_t /*key*/) {
    return true;
  }
  template <class WalkT>
  static bool scattered(const WalkT& /*walk*/, const Vertex<MisBlock>& /*v*/) {
    return true;
  }
};

// Claim: where no surface lets light pass straight on, techniques that judge edges by their media and stop at
// any hit bring, bit for bit, what they bring if all that stands on an edge is looked for; with fewer rays.
TEST(BlockedEdges, MediaTellOfWhatRaysFind) {
  const auto scene = test::build_scene(kBalls, {}, kCamera);
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  ASSERT_FALSE((*scene)->features().any_passthrough);
  WalkRules rules;
  rules.max_edges = 12;
  rules.rr_depth = 1u << 30;
  const MisFactors factors{1, 1, 1, 1, 1};
  film::SampleCounts few, all, unread;
  const ConnectContext media_tell{**scene, factors, rules, few},
      all_traced{**scene, factors, rules, all, reads_emitter_choice(**scene), true};
  samplers::Sampler sampler(samplers::SamplerKind::independent, 5);
  Subpath<MisBlock> light;
  VertexPair<MisBlock> room;
  Keeper keeper;
  BothWays both{media_tell, all_traced, light};
  for (std::uint32_t i = 0; i < 2000; ++i) {
    sampler.start_light(0, 0, i);
    LightWalk walk(**scene, rules, factors, sampler, unread);
    follow_light_path(walk, light, keeper);
    sampler.start(0, 0, i % 16, i / 16 % 16);
    float weight = 1;
    const Ray ray = (*scene)->camera_ray(static_cast<float>(i % 16) / 16,
                                         static_cast<float>(i / 16 % 16) / 16, {0.5f, 0.5f}, weight);
    EyeWalk eye(**scene, rules, factors, sampler, unread);
    follow_eye_path(eye, ray, room, both);
  }
  std::printf("%u techniques bring something, %u nothing; %llu rays in place of %llu\n", both.made[1],
              both.made[0], static_cast<unsigned long long>(few.rays),
              static_cast<unsigned long long>(all.rays));
  EXPECT_GT(both.made[1], 10000U);
  EXPECT_GT(both.made[0], 10000U);
  EXPECT_LT(few.rays, all.rays);
}

}  // namespace
}  // namespace candela::transport
