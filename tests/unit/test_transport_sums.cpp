// Claim: the weights that the techniques' own code gives one path add up to 1, over all techniques that an
// integrator runs: light met, next event estimation, connections, light images, lenses met, merging on
// surfaces and the four merges in media. Neither the oracle nor a formula of the test is asked: an eye's walk
// makes a path, a light walk is led along it (led_walk.h), and each technique joins the two at its place.
// For the heuristics of path, light, bdpt, bpm, vcm, vcmplus (eta by the place on the film) and every list of
// upbp, with beams of both kinds, few connections, hits to expect and no merging on surfaces. Paths have
// vertices on surfaces and in media, matt, glossy and in glass.
//
// Tolerance: floats. The led walk meets the path's places to 1e-7 of the room, and each density on the way
// has that much over the narrowness of its lobe or the length of its edge. Deterministic: fixed seeds.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "tests/unit/scene_fixture.h"
#include "tests/unit/weight_sum.h"
#include "worker/estimators/options.h"
#include "worker/estimators/path.h"
#include "worker/integrators/merging/scales.h"
#include "worker/integrators/upbp/scales.h"

namespace candela::transport {
namespace {

// A closed room, all of whose walls emit but for one, with a box of colored fog in which are a block of glass
// that has fog of its own, a glossy wall and a block of denser fog; `empty`: the walls and the glossy one
// alone.
std::unique_ptr<scene::Scene> room(const std::string& lens, bool lamp_is_a_point, bool empty = false) {
  const auto wall = [](const std::string& m, bool emits) {
    return fmt::format(
        R"(<shape type="rectangle"><transform name="to_world"><matrix value="{}"/></transform>
           <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.5, 0.6, 0.7"/></bsdf></bsdf>{}</shape>)",
        m, emits ? R"(<emitter type="area"><rgb name="radiance" value="0.5"/></emitter>)" : "");
  };
  const bool emits = !lamp_is_a_point;
  std::string body =
      R"(<medium id="thin" type="homogeneous"><rgb name="sigma_t" value="0.9, 0.6, 0.4"/><rgb name="albedo" value="0.9, 0.8, 0.7"/>
           <phase type="hg"><float name="g" value="0.4"/></phase></medium>
         <medium id="thick" type="homogeneous"><rgb name="sigma_t" value="2"/><rgb name="albedo" value="0.9"/></medium>)";
  body += wall("1 0 0 0 0 1 0 0 0 0 1 -1 0 0 0 1", emits) + wall("1 0 0 0 0 -1 0 0 0 0 -1 1 0 0 0 1", emits) +
          wall("0 0 1 -1 1 0 0 0 0 1 0 0 0 0 0 1", emits) + wall("0 0 -1 1 -1 0 0 0 0 1 0 0 0 0 0 1", emits) +
          wall("1 0 0 0 0 0 -1 1 0 1 0 0 0 0 0 1", emits) + wall("-1 0 0 0 0 0 1 -1 0 1 0 0 0 0 0 1", false);
  if (lamp_is_a_point)
    body +=
        R"(<emitter type="point"><point name="position" x="0.3" y="-0.4" z="0.8"/><rgb name="intensity" value="1"/><ref id="thin"/></emitter>)";
  if (!empty)
    body +=
        R"(<shape type="cube"><transform name="to_world"><scale value="0.96"/></transform><bsdf type="null"/><ref name="interior" id="thin"/></shape>
         <shape type="cube"><transform name="to_world"><scale x="0.3" y="0.2" z="0.3"/><rotate z="1" angle="20"/><translate x="0.4" y="0.3" z="-0.4"/></transform>
           <bsdf type="dielectric"/><ref name="exterior" id="thin"/><ref name="interior" id="thick"/></shape>
         <shape type="cube"><transform name="to_world"><scale value="0.25"/><rotate y="1" angle="30"/><translate x="-0.4" y="0.2" z="-0.3"/></transform>
           <bsdf type="null"/><ref name="exterior" id="thin"/><ref name="interior" id="thick"/></shape>)";
  body +=
      R"(<shape type="rectangle"><transform name="to_world"><scale value="0.3"/><rotate x="1" angle="60"/><translate x="-0.1" y="0.6" z="0.45"/></transform>
           <bsdf type="twosided"><bsdf type="roughconductor"><float name="alpha" value="0.3"/></bsdf></bsdf></shape>)";
  const std::string sensor = fmt::format(
      R"(<sensor type="{}"><float name="fov" value="70"/>{}{}
         <transform name="to_world"><lookat origin="-0.2, -0.85, 0.1" target="0, 0.4, -0.1" up="0, 0, 1"/></transform></sensor>)",
      lens.empty() ? "perspective" : "thinlens", lens, empty ? "" : R"(<ref name="medium" id="thin"/>)");
  scene::Scene::Options options;
  options.film_width = options.film_height = test::kFilmSize;
  auto scene = test::build_scene(body, {}, sensor, options);
  EXPECT_TRUE(scene.ok()) << scene.error().to_string();
  return std::move(*scene);
}

constexpr const char* kLens =
    R"(<float name="aperture_radius" value="0.05"/><float name="focus_distance" value="1"/>)";

Techniques only(std::initializer_list<bool Techniques::*> run) {
  Techniques t = Techniques::none();
  for (bool Techniques::*one : run) t.*one = true;
  return t;
}

template <class Mis>
Weighing merging(std::string name, Techniques techniques, double radius, double slope = 0) {
  return {std::move(name),
          techniques,
          {integrators::merging::make_scale<Mis>(Kernel::constant, radius, radius, kPaths, techniques).eta,
           slope},
          {},
          1};
}

// The lists of upbp, as it makes them.
Weighing unified(const scene::Scene& scene, std::uint64_t i, bool lens) {
  const std::uint64_t list = 1 + i % 31, more = i / 31;
  const bool connects = (list & 16) != 0;
  integrators::upbp::MediumRules rules;
  rules.pp3d = (list & 1) != 0;
  rules.pb2d = (list & 2) != 0;
  rules.bp2d = (list & 4) != 0;
  rules.bb1d = (list & 8) != 0;
  rules.long_photon_beams = more % 2 == 1;
  rules.long_query_beams = more / 2 % 2 == 1;
  rules.merge_surfaces = more % 5 != 3;
  rules.connect_media = more % 3 == 2 ? 0.125 : 1;
  rules.free_paths = more % 4 == 3 ? 0 : 0.25;
  rules.radius_bb1d = more % 7 == 4 ? 0.02 : 0;
  Techniques t;
  t.merge_surface = rules.merge_surfaces;
  t.merge_medium = rules.any();
  if (!connects) t.next_event = t.connect = t.light_image = t.hit_lens = false;
  t.hit_lens = t.hit_lens && lens;
  integrators::upbp::ExpectedHits hits;
  if (more % 3 == 1) hits = {{3, 7, 0.5, 20}};
  constexpr double kRadii[] = {0.1, 0.01, 0.3};
  const auto scales = integrators::upbp::iteration_scales(rules, {Kernel::epanechnikov, 0, 0, 0, 0.75, 1}, t,
                                                          scene, kRadii[i % 3], i % 4, kPaths, 256, hits);
  return {fmt::format("upbp list {} variant {}", list, more),
          t,
          {scales.surfaces.scale.eta, 0},
          scales.eta,
          rules.connect_media};
}

void expect_one(const Sums& sums, const char* what, std::size_t least_paths) {
  std::printf(
      "%s: %zu paths, %zu of them mixed, %zu met the lens, %zu lost; largest error %.1e, %zu beyond\n", what,
      sums.paths, sums.mixed, sums.met_lens, sums.lost, sums.largest, sums.beyond);
  EXPECT_GE(sums.paths, least_paths);
  EXPECT_GE(sums.mixed, sums.paths / 8);
  EXPECT_LE(sums.lost, sums.paths / 5);
  EXPECT_LE(sums.beyond, sums.paths / 100) << sums.worst;
  EXPECT_LE(sums.largest, 1e-3) << sums.worst;
}

constexpr double kTolerance = 1e-5;
constexpr std::uint32_t kEdges = 6;

template <class Mis>
void expect_sums(const scene::Scene& scene, const std::vector<Weighing>& all, const char* what,
                 std::size_t least_paths) {
  Sums sums;
  for (std::size_t w = 0; w < all.size(); ++w) {
    SumTest<Mis> test(scene, all[w], kEdges, kTolerance, sums);
    for (std::uint64_t i = 0; i < 60; ++i) test.run(i * all.size() + w);
  }
  expect_one(sums, what, least_paths);
}

class WeightSums : public testing::TestWithParam<int> {
 protected:
  bool lens() const { return GetParam() == 1; }
  std::unique_ptr<scene::Scene> made() const { return room(lens() ? kLens : "", GetParam() == 2); }
};

template <class Mis>
std::vector<Weighing> without_beams(bool lens) {
  using T = Techniques;
  Techniques all;
  all.hit_lens = lens;
  Techniques connections = all;
  connections.merge_surface = connections.merge_medium = false;
  std::vector<Weighing> list = {
      {"path", only({&T::hit_light, &T::next_event}), {}, {}, 1},
      {"bdpt", connections, {}, {}, 1},
      merging<Mis>("bpm", only({&T::hit_light, &T::merge_surface, &T::merge_medium}), 0.05),
      merging<Mis>("bpm", only({&T::hit_light, &T::merge_surface, &T::merge_medium}), 0.003),
      merging<Mis>("vcm", all, 0.1),
      merging<Mis>("vcm", all, 0.01),
      merging<Mis>("vcmplus", all, 0.03, 0.05)};
  return list;
}

TEST_P(WeightSums, OfTheBalanceHeuristicAreOne) {
  const auto scene = made();
  expect_sums<Balance>(*scene, without_beams<Balance>(lens()), "balance", 150);
}

TEST_P(WeightSums, OfThePowerHeuristicAreOne) {
  const auto scene = made();
  expect_sums<Power>(*scene, without_beams<Power>(lens()), "power", 150);
}

TEST_P(WeightSums, OfEveryListOfUpbpAreOne) {
  const auto scene = made();
  Sums sums;
  for (std::uint64_t i = 0; i < 31 * 12; ++i) {
    const Weighing weighing = unified(*scene, i, lens());
    SumTest<BeamBalance> test(*scene, weighing, kEdges, kTolerance, sums);
    for (std::uint64_t path = 0; path < 4; ++path) test.run(4 * i + path);
  }
  expect_one(sums, "upbp", 400);
}

// The random numbers of the path tracer's first vertex.
struct PathSampler {
  float choice = 0.5f, lobe = 0.5f;
  Vec2 point, direction;
  float draw_1d(std::uint32_t dimension, bool /*stratified*/) const {
    return dimension == kEyeDimensions + path_block::kEmitterChoice ? choice : lobe;
  }
  Vec2 draw_2d(std::uint32_t dimension, bool /*stratified*/) const {
    return dimension == kEyeDimensions + path_block::kEmitterPoint ? point : direction;
  }
};

// Claim: path's two techniques, made to find the same point of a light from the same place, give together
// what their values A and B alone and the heuristic say: with densities as 1 / A and 1 / B the weights are
// B / (A + B) and A / (A + B), and add up to 1; likewise for their squares.
TEST(WeightSums, OfThePathTracerAreOne) {
  const auto scene = room("", false, true);
  std::size_t checked = 0, beyond = 0;
  double largest = 0;
  for (std::uint64_t i = 0; i < 400; ++i) {
    rng::Stream stream(rng::key(29, i));
    float response = 1;
    const Ray ray = scene->camera_ray(stream.next_float() * test::kFilmSize,
                                      stream.next_float() * test::kFilmSize, {0.5f, 0.5f}, response);
    ScatterPoint v;
    scene::ClosureArena arena;
    if (!scene->intersect(ray, v.hit)) continue;
    v.wo = -ray.direction;
    const Vec3 wo = v.hit.shading.to_local(v.wo);
    v.closure = scene->closure(v.hit, wo, arena);
    if (v.closure.black || v.closure.purely_delta()) continue;
    v.front = wo.z < 0 ? -v.hit.shading.n : v.hit.shading.n;
    PathSampler sampler;
    sampler.choice = stream.next_float();
    sampler.point = {stream.next_float(), stream.next_float()};
    scene::DirectSample light;
    if (scene->sample_direct(v.hit, v.front, sampler.choice, sampler.point, light) !=
            scene::DirectOutcome::sampled ||
        scene->occluded(light.shadow_ray))
      continue;
    LedSampler led;
    if (test::lead_scattering(*scene, v, Vec3d(light.wi), false, TransportMode::radiance, led) > 1e-6)
      continue;
    sampler.lobe = led.lobe;
    sampler.direction = led.direction;
    const auto radiance = [&](bool direct, bool met, MisHeuristic heuristic) {
      estimators::PathOptions options;
      options.max_depth = options.min_edges = 2;
      options.rr_depth = 1u << 30;
      options.heuristic = heuristic;
      Techniques techniques = Techniques::none();
      techniques.next_event = direct;
      techniques.hit_light = met;
      film::SampleCounts sample_counts;
      estimators::PathTracer<EdgeContent::nothing, scene::Scene, PathSampler> tracer(
          *scene, options, techniques, sampler, sample_counts);
      return static_cast<double>(tracer.radiance(ray).r);
    };
    const double a = radiance(true, false, MisHeuristic::balance),
                 b = radiance(false, true, MisHeuristic::balance);
    if (!(a > 0) || !(b > 0)) continue;
    ++checked;
    const double balance = radiance(true, true, MisHeuristic::balance) * (a + b) / (2 * a * b),
                 power = radiance(true, true, MisHeuristic::power) * (a * a + b * b) / (a * b * (a + b));
    const double error = std::max(std::abs(balance - 1), std::abs(power - 1));
    beyond += error > kTolerance ? 1 : 0;
    largest = std::max(largest, error);
  }
  std::printf("path: %zu paths, largest error %.1e, %zu beyond\n", checked, largest, beyond);
  EXPECT_GE(checked, 100U);
  EXPECT_LE(beyond, checked / 50);
  EXPECT_LE(largest, 1e-3);
}

std::string lamp_name(const testing::TestParamInfo<int>& info) {
  constexpr const char* kNames[] = {"walls_that_emit", "a_lens", "a_point_light"};
  return kNames[info.param];
}
INSTANTIATE_TEST_SUITE_P(Rooms, WeightSums, testing::Values(0, 1, 2), lamp_name);

}  // namespace
}  // namespace candela::transport
