// Walks from the light that meet the lens, and what an observer of a walk is shown.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <numbers>
#include <string>

#include "tests/unit/scene_fixture.h"
#include "worker/transport/mis/unweighted.h"
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

// Number of `walks` that meet the lens with their edge number max_edges + 1, which is there for that alone.
template <EdgeContent kEdgeContent>
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
  film::SampleCounts sample_counts;
  samplers::Sampler sampler(samplers::SamplerKind::independent, 5);
  int meetings = 0;
  Vertex<MisBlock> v;
  scene::ClosureArena arena;
  for (int i = 0; i < walks; ++i) {
    sampler.start_light(0, 0, static_cast<std::uint64_t>(i));
    using LightWalk = Walk<scene::TransportMode::importance, kEdgeContent, Balance>;
    LightWalk walk(**scene, rules, factors, sampler, sample_counts);
    if (!walk.start_light()) continue;
    for (;;) {
      const auto event = walk.advance(v, arena);
      EXPECT_LE(walk.lens().met ? walk.lens().edges : 0, max_edges + 1);
      meetings += walk.lens().met && walk.lens().edges == max_edges + 1 ? 1 : 0;
      if (event != LightWalk::Event::vertex) break;
      EXPECT_TRUE(v.edges <= max_edges || !v.connectible);
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
    const int open = last_edge_meetings<EdgeContent::surfaces>(kWallAndLamp, max_edges, kWalks);
    const int through = last_edge_meetings<EdgeContent::surfaces>(kWallAndLamp + kSheet, max_edges, kWalks);
    const int media = last_edge_meetings<EdgeContent::media>(kWallAndLamp + kSheet, max_edges, kWalks);
    EXPECT_GT(open, 100) << max_edges;
    EXPECT_NEAR(through, open, 5 * std::sqrt(open + through)) << max_edges;
    EXPECT_NEAR(media, open, 5 * std::sqrt(open + media)) << max_edges;
  }
}

struct Sightings {
  int stretches = 0, scattered = 0, survived = 0;
  bool open = false;  // a stretch whose flight has not ended
  MediumSegment last;
};
struct CountingObserver {
  Sightings* seen;
  void stretch(const MediumSegment& segment) {
    EXPECT_FALSE(seen->open);
    seen->open = true;
    ++seen->stretches;
    seen->last = segment;
  }
  static std::vector<scene::FlightStep>* steps() { return nullptr; }
  void scattered(float distance) {
    EXPECT_TRUE(seen->open);
    EXPECT_LT(distance, seen->last.ray.t_max);
    seen->open = false;
    ++seen->scattered;
  }
  void survived() {
    EXPECT_TRUE(seen->open);
    seen->open = false;
    ++seen->survived;
  }
};

// Claim: before each flight an observer sees the whole stretch of the medium, as the ray meets it, and the
// walk's throughput there; then whether the walk scattered or survived; and it changes nothing of the walk.
TEST(EyeWalk, ShowsAnObserverEachStretchOfAMedium) {
  const auto scene = test::build_scene(
      R"(<shape type="cube"><transform name="to_world"><translate z="4"/></transform><bsdf type="null"/>
         <medium name="interior" type="homogeneous"><rgb name="sigma_t" value="1, 0.8, 0.6"/>
         <rgb name="albedo" value="0.9"/></medium></shape>
         <shape type="sphere"><float name="radius" value="20"/><emitter type="area"/></shape>)");
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  WalkRules rules;
  rules.max_edges = 6;
  const MisFactors factors;
  film::SampleCounts sample_counts;
  samplers::Sampler sampler(samplers::SamplerKind::independent, 5);
  using Observed =
      Walk<TransportMode::radiance, EdgeContent::media, Balance, samplers::Sampler, CountingObserver>;
  using Plain = Walk<TransportMode::radiance, EdgeContent::media, Balance>;
  Sightings seen;
  int medium_vertices = 0, passed_whole = 0;
  for (std::uint64_t i = 0; i < 2000; ++i) {
    float weight = 1;
    const Ray ray =
        (*scene)->camera_ray(0.3f + 0.4f * static_cast<float>(i % 20) / 20, 0.5f, {0.5f, 0.5f}, weight);
    sampler.start(0, i, 0, 0);
    Observed walk(**scene, rules, factors, sampler, sample_counts, CountingObserver{&seen});
    Plain plain(**scene, rules, factors, sampler, sample_counts);
    walk.start_eye(ray);
    plain.start_eye(ray);
    Vertex<MisBlock> v, w;
    scene::ClosureArena arena, other;
    for (;;) {
      const int stretches = seen.stretches;
      const auto event = walk.advance(v, arena);
      ASSERT_EQ(static_cast<int>(event), static_cast<int>(plain.advance(w, other)));
      if (event != Observed::Event::vertex) break;
      ASSERT_EQ(v.throughput.g, w.throughput.g);
      ASSERT_EQ(v.mis.known, w.mis.known);
      medium_vertices += v.on_surface() ? 0 : 1;
      if (seen.stretches > stretches) {
        EXPECT_EQ(seen.last.edges, v.edges);
        SurfaceHit end;
        const bool found = (*scene)->intersect({seen.last.ray.origin, seen.last.ray.direction}, end);
        ASSERT_TRUE(found);
        EXPECT_LE(seen.last.ray.t_max, end.distance);
        EXPECT_GT(seen.last.ray.t_max, end.distance - 1e-3f);  // short of the surface by its error
        passed_whole += v.on_surface() ? 1 : 0;
      }
      const auto step = walk.scatter(v);
      ASSERT_EQ(static_cast<int>(step), static_cast<int>(plain.scatter(w)));
      if (step == Observed::Step::ended) break;
    }
    ASSERT_FALSE(seen.open);  // no channel absorbs all
  }
  EXPECT_EQ(seen.stretches, seen.scattered + seen.survived);
  // A scattering on the last edge is no vertex.
  EXPECT_GE(seen.scattered, medium_vertices);
  EXPECT_EQ(seen.survived, passed_whole);
  EXPECT_GT(medium_vertices, 1000);
  EXPECT_GT(passed_whole, 1000);
}

// Claim: in a medium that absorbs nothing roulette loses no light, and the weight of a walk of n vertices is
// about n / 7.5, where 0.95 a vertex would give 10^13 to one of 600. All walks of n vertices have one weight,
// which times their share is 1, to 5 standard errors (6e-7 by chance for each of four).
TEST(EyeWalk, WeightsOfLongWalksInMediaGrowAsTheirVertices) {
  const auto scene = test::build_scene(
      R"(<shape type="sphere"><float name="radius" value="1e5"/><bsdf type="null"/>
         <medium name="interior" type="homogeneous"><float name="sigma_t" value="1"/>
         <rgb name="albedo" value="1"/></medium></shape>)");
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  const WalkRules rules;
  const MisFactors factors;
  film::SampleCounts sample_counts;
  samplers::Sampler sampler(samplers::SamplerKind::independent, 5);
  constexpr std::array<std::uint32_t, 4> kLengths{20, 60, 200, 600};
  constexpr std::uint64_t kWalks = 20'000;
  std::array<std::uint64_t, 4> walks{};
  std::array<double, 4> weights{};
  for (std::uint64_t i = 0; i < kWalks; ++i) {
    sampler.start(0, i, 0, 0);
    Walk<TransportMode::radiance, EdgeContent::media, Unweighted> walk(**scene, rules, factors, sampler,
                                                                       sample_counts);
    walk.start_eye({{0, 0, 0}, {0, 0, 1}});
    Vertex<NoBlock> v;
    scene::ClosureArena arena;
    for (std::size_t next = 0; next < kLengths.size();) {
      ASSERT_EQ(static_cast<int>(walk.advance(v, arena)), static_cast<int>(decltype(walk)::Event::vertex));
      if (v.edges == kLengths[next]) {
        ++walks[next];
        weights[next++] = static_cast<double>(v.throughput.g);
      }
      if (walk.scatter(v) == decltype(walk)::Step::ended) break;
    }
  }
  for (std::size_t i = 0; i < kLengths.size(); ++i) {
    SCOPED_TRACE(kLengths[i]);
    const double share = static_cast<double>(walks[i]) / static_cast<double>(kWalks);
    EXPECT_NEAR(share * weights[i], 1, 5 * weights[i] * std::sqrt(share / static_cast<double>(kWalks)));
    EXPECT_NEAR(weights[i], kLengths[i] / 7.5, 0.03 * kLengths[i]);
  }
}

// Claim: the second vertices of walks from a lamp of one watt, sigma_t = 1 and albedo 0.8, are as many at a
// distance of 1.3 as the fluence of light scattered once says: 1.417016205e-2 (../shared/theory/upbp.md, 18),
// within 5 standard errors (6e-7 by chance).
TEST(LightWalk, SecondVerticesHaveTheFluenceOfLightScatteredOnce) {
  const auto scene = test::build_scene(
      R"(<medium id="fog" type="homogeneous"><float name="sigma_t" value="1"/><rgb name="albedo" value="0.8"/></medium>
         <emitter type="point"><rgb name="intensity" value="0.07957747154594767"/><ref id="fog"/></emitter>
         <shape type="sphere"><float name="radius" value="100"/><bsdf type="null"/><ref name="interior" id="fog"/></shape>)");
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  constexpr double kFrom = 1.28, kTo = 1.32, kAlbedo = 0.8;
  constexpr std::uint64_t kWalks = 1'000'000;
  const WalkRules rules;
  const MisFactors factors;
  film::SampleCounts sample_counts;
  samplers::Sampler sampler(samplers::SamplerKind::independent, 5);
  double sum = 0, squares = 0;
  scene::ClosureArena arena;
  Vertex<NoBlock> v;
  for (std::uint64_t i = 0; i < kWalks; ++i) {
    sampler.start_light(0, 0, i);
    Walk<TransportMode::importance, EdgeContent::media, Unweighted> walk(**scene, rules, factors, sampler,
                                                                         sample_counts);
    using Event = decltype(walk)::Event;
    ASSERT_TRUE(walk.start_light());
    if (walk.advance(v, arena) != Event::vertex || walk.scatter(v) == decltype(walk)::Step::ended) continue;
    if (walk.advance(v, arena) != Event::vertex) continue;
    const double r = length(Vec3d(v.hit.p));
    if (r < kFrom || r > kTo) continue;
    const double flux = static_cast<double>(v.throughput.g) / kAlbedo;  // sigma_s
    sum += flux;
    squares += flux * flux;
  }
  const double volume = 4.0 / 3 * std::numbers::pi * (kTo * kTo * kTo - kFrom * kFrom * kFrom);
  const double fluence = sum / volume / static_cast<double>(kWalks);
  const double error = std::sqrt(squares) / volume / static_cast<double>(kWalks);
  std::printf("fluence %.5e +- %.1e\n", fluence, error);
  EXPECT_LT(error, 0.02 * fluence);
  EXPECT_NEAR(fluence, 1.417016205e-2, 5 * error);
}

}  // namespace
}  // namespace candela::transport
