// The merging radius of the first iteration that a job without a radius has: against densities of photons
// that are known.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <string>

#include "tests/unit/scene_fixture.h"
#include "worker/integrators/merging/chosen_radius.h"
#include "worker/integrators/merging/first_radius.h"
#include "worker/scene/scene.h"

namespace candela::integrators::merging {
namespace {

struct Job {
  std::unique_ptr<scene::Scene> scene;
  film::PixelFilter filter;
  std::uint32_t width, height;
  UnitContext context(std::uint64_t seed = 1) const {
    return {*scene, filter, samplers::SamplerKind::sobol, seed, width, height};
  }
};

Job job(const std::string& body, std::uint32_t width, std::uint32_t height, const std::string& sensor = "") {
  scene::Scene::Options options;
  options.film_width = width;
  options.film_height = height;
  auto scene = test::build_scene(body, {}, sensor, options);
  auto filter = film::PixelFilter::create("box", {});
  if (!scene.ok()) throw std::runtime_error(scene.error().to_string());
  return {std::move(*scene), std::move(*filter), width, height};
}

// A floor across the view, 5 off, with a point light beside the camera, `aside` along the floor.
std::string lit_floor(const std::string& aside = "0") {
  return "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"10\"/><rotate x=\"1\" "
         "angle=\"180\"/><translate z=\"5\"/></transform></shape><emitter type=\"point\"><point "
         "name=\"position\" x=\"" +
         aside + "\" y=\"0\" z=\"0\"/></emitter>";
}

// Photons of P paths per area in the median of a square view of 60 degrees: see
// FirstRadiusFollowsTheNeighbors.
double median_density(double paths) {
  return paths * 0.749 / (100 * std::numbers::pi);
}

// For an integrator that merges alone.
estimators::Techniques merging_alone(bool in_media = false) {
  estimators::Techniques techniques = estimators::Techniques::none();
  techniques.merge_surface = true;
  techniques.merge_medium = in_media;
  return techniques;
}

ChosenRadius chosen(const Job& job, const MergeRules& rules = {},
                    const estimators::Techniques& techniques = merging_alone()) {
  return choose_radius(job.context(), rules, {}, techniques);
}

// Claim: with no radius given the disc of the first radius holds ten photons of an iteration, with any number
// of light paths on films from 48 x 48 to 4096 x 4096, where that is at most as wide as may be. The k-th
// distance of ten photons has a relative deviation of 16 %, and the median is over at least 16 independent
// ones.
TEST(AutomaticRadius, HoldsTenPhotonsOnFilmsOfAnySize) {
  for (const std::uint32_t side : {48U, 128U, 1024U, 4096U})
    for (const double light_paths : {20.0, 64.0}) {
      MergeRules rules;
      rules.light_paths = light_paths;
      const Job of_side = job(lit_floor(), side, side);
      const double paths = light_paths * side * side;
      const double expected = std::sqrt(10 / (std::numbers::pi * median_density(paths)));
      const ChosenRadius radius = chosen(of_side, rules);
      EXPECT_NEAR(radius.value, expected, 0.15 * expected) << side << ", " << light_paths;
      EXPECT_EQ(radius.why.find("10 photons"), 0U) << radius.why;
    }
}

// Claim: radius_neighbors goes before radius_pixels, and that before radius; any of them stands as it is
// given.
TEST(AutomaticRadius, GivesWayToAnyThatIsGiven) {
  const Job small = job(lit_floor(), 48, 48);
  const auto sphere = static_cast<double>(small.scene->features().radius);
  MergeRules rules;
  rules.radius = 0.9;
  EXPECT_EQ(chosen(small, rules).value, 0.9 * sphere);
  rules.radius_pixels = 30;
  EXPECT_EQ(chosen(small, rules).value, 30 * pixel_footprint(small.context()));
  rules.radius_neighbors = 200;
  const double expected = std::sqrt(200 / (std::numbers::pi * median_density(48 * 48)));
  EXPECT_NEAR(chosen(small, rules).value, expected, 0.15 * expected);
}

// Claim: where photons are rare in view the radius ends at two pixels, at half of one if there are
// connections, at one if radii adapt; at 0.003 of the scene's bounding sphere if that is more; so it is where
// a pilot finds no photons, or nothing that merges.
TEST(AutomaticRadius, HasBounds) {
  const Job away = job(lit_floor("12"), 48, 48), large = job(lit_floor("12"), 2048, 2048);
  const double pixel = pixel_footprint(away.context());
  EXPECT_NEAR(pixel, 2 * 5 * std::tan(std::numbers::pi / 6) / 48, 0.1 * pixel);
  estimators::Techniques connecting = merging_alone();
  connecting.connect = true;
  EXPECT_DOUBLE_EQ(chosen(away).value, 2 * pixel);
  EXPECT_NE(chosen(away).why.find("at most 2 pixels"), std::string::npos) << chosen(away).why;
  const double fraction = 0.003 * static_cast<double>(away.scene->features().radius);
  EXPECT_DOUBLE_EQ(chosen(away, {}, connecting).value, std::max(0.5 * pixel, fraction));
  MergeRules adapting;
  adapting.adapts = true;
  EXPECT_DOUBLE_EQ(chosen(away, adapting, connecting).value, std::max(pixel, fraction));
  EXPECT_DOUBLE_EQ(chosen(large).value, 0.003 * static_cast<double>(large.scene->features().radius));
  const std::string floor =
      "<shape type=\"rectangle\"><transform name=\"to_world\"><translate z=\"-5\"/>"
      "</transform></shape>";
  for (const std::string& body : {floor, floor + "<emitter type=\"point\"/>"}) {
    const Job nothing = job(body, 64, 64);
    EXPECT_DOUBLE_EQ(chosen(nothing).value, 0.003 * static_cast<double>(nothing.scene->features().radius));
  }
}

// Claim: in fog alone the ball holds ten photons, if media merge; else the radius is that of no photons.
TEST(AutomaticRadius, OfMediaIsABalls) {
  // A point light in the middle of a ball of fog so thin that photons stay where they first scatter: r << 1 /
  // s.
  const std::string fog =
      "<shape type=\"sphere\"><float name=\"radius\" value=\"4\"/><bsdf type=\"null\"/><medium "
      "name=\"interior\" "
      "type=\"homogeneous\"><float name=\"sigma_t\" value=\"0.05\"/><float name=\"albedo\" "
      "value=\"1\"/></medium>"
      "</shape><emitter type=\"point\"><point name=\"position\" x=\"0\" y=\"0\" z=\"0\"/></emitter>";
  // A view from outside.
  const std::string sensor =
      "<sensor type=\"perspective\"><float name=\"fov\" value=\"30\"/><transform name=\"to_world\"><lookat "
      "origin=\"0,0,-12\" target=\"0,0,0\" up=\"0,1,0\"/></transform></sensor>";
  const Job in_fog = job(fog, 128, 128, sensor);
  const double fallback = 0.003 * static_cast<double>(in_fog.scene->features().radius);
  EXPECT_DOUBLE_EQ(chosen(in_fog).value, fallback);
  MergeRules rules;
  rules.light_paths = 16;
  const double ball = chosen(in_fog, rules, merging_alone(true)).value;
  // At the distance d from the light: P s exp(-s d) / (4 pi d^2) photons per volume. The walk of a camera ray
  // first scatters at 1 to 4 from the light, mostly: the middle is near 2.5.
  const auto radius_at = [](double d) {
    const double density = 16 * 16384 * 0.05 * std::exp(-0.05 * d) / (4 * std::numbers::pi * d * d);
    return std::cbrt(10 / (4.0 / 3 * std::numbers::pi * density));
  };
  EXPECT_GT(ball, radius_at(1.25));
  EXPECT_LT(ball, radius_at(3.5));
}

// Claim: the choice is a function of the job: the same twice, whatever the scene was asked before.
TEST(AutomaticRadius, IsAFunctionOfTheJob) {
  const Job first = job(lit_floor(), 100, 50), again = job(lit_floor(), 100, 50);
  const double one = chosen(first).value;
  chosen(again, {.radius_neighbors = 3});
  EXPECT_EQ(chosen(again).value, one);
  EXPECT_EQ(chosen(first).value, one);
}

}  // namespace
}  // namespace candela::integrators::merging
