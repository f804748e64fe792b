// Chains whose states are paths, through every sweep: most of it is too noisy to be held to a value in the
// tests' time, but nothing may break there.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <set>
#include <string>
#include <vector>

#include "tests/statistical/chain_driver.h"
#include "tests/statistical/harness.h"
#include "tests/stress/run.h"
#include "tests/stress/scenes.h"

namespace candela::stress {
namespace {

// Vertices that come together: those on both sides of a pane of glass, before a matt wall as near behind.
Sweep coincident() {
  Sweep sweep;
  sweep.name = "coincident";
  sweep.values = sweep.thin = {0.1, 1e-3, 1e-5, 1e-6, 1e-7, 1e-9};
  sweep.iterations = 8;
  sweep.shot = [](double value) {
    return uniform_shot(
        perspective({0.4, 0.3, 2}, {0, 0, 0}, {0, 1, 0}, 30) + constant_sky(0.5) + plate("", diffuse(0.5)) +
            fmt::format(R"(<shape type="cube"><transform name="to_world"><scale z="{0}"/><translate z="{1}"/>
                  </transform><bsdf type="dielectric"/></shape>)",
                        value / 2, 1.5 * value) +
            sphere({0, 0, 1.5}, 0.2, area_light(3)),
        1);
  };
  return sweep;
}

// As the runner makes it (run.cpp, whose text is in the digests of all proofs).
statistical::TestScene scene_of(const Shot& shot, const Claim& claim) {
  statistical::TestScene scene;
  auto files = shot.files;
  files["scene.xml"] = "<scene version=\"3.0.0\"><integrator type=\"path\"/>" + shot.body + "</scene>";
  scene.files = std::make_shared<statistical::MemorySource>(std::move(files));
  scene.main_key = "scene.xml";
  scene = statistical::read_scene(std::move(scene), shot.width, shot.height);
  for (const auto& [key, value] : shot.settings) scene.from_scene[key] = value;
  return statistical::with_integrator(std::move(scene), claim.integrator, claim.settings);
}

std::vector<Claim> claims() {
  Sweep none;
  add_path_states(none);
  return none.claims;
}

bool finite(const std::vector<double>& image) {
  return std::ranges::all_of(image, [](double x) { return std::isfinite(x); });
}

// These sweeps bring vertices, slopes and lobes to their limits: the test takes all of their values.
bool hard_for_paths(const std::string& name) {
  const std::vector<std::string> some = {"rough-mirror",   "rough-mirror-ggx", "rough-glass", "grazing-glass",
                                         "critical-angle", "offset",           "coincident"};
  return std::ranges::count(some, name) > 0;
}

// `done`: what ran. Sweeps of a radius of merging, or of where iterations begin, give a chain one scene again
// and again.
void check(const Sweep& sweep, const Claim& claim, double value, std::set<std::string>& done) {
  SCOPED_TRACE(fmt::format("{} {} {}", sweep.name, claim.integrator, value));
  const Shot shot = complete_shot(sweep, value);
  const statistical::TestScene scene = scene_of(shot, claim);
  std::string what = fmt::format("{} {}", sweep.iterations, statistical::identity(scene));
  for (const auto& [key, bytes] : shot.files) what += key + bytes;
  if (!done.insert(what).second) return;
  if (claim.integrator == "erpt") {
    const NamedState state = statistical::pilot_state(scene);
    const auto renderer = statistical::make_renderer(scene);
    auto output = renderer->make_output(state);
    ASSERT_TRUE(
        renderer->run({Unit::Kind::iterations, 0, 0, sweep.iterations}, {state, {}, {}}, output, {}).ok());
    EXPECT_EQ(output.film->sample_counts().rejected, film::SampleCounts().rejected);
    return;
  }
  const auto image = statistical::render_chains({scene, 1, 1, 1}, 46);
  EXPECT_TRUE(finite(image.image));
  EXPECT_EQ(image.sample_counts.rejected, film::SampleCounts().rejected);
  std::vector<chains::MutationCounts> all;
  std::uint64_t accepted = 0;
  for (const auto& record : image.records) {
    chains::add(all, record.counts.by_mutation);
    accepted += record.counts.accepted;
  }
  // A job that found light has chains, and they move.
  EXPECT_TRUE(accepted > 0 || !(image.b.b > 0));
  std::string line;
  for (const chains::MutationCounts& one : all) {
    std::uint64_t failed = 0;
    line += fmt::format(" {} {}/{}", one.name, one.accepted, one.proposed);
    for (std::size_t i = 0; i < one.failed.size(); ++i) {
      failed += one.failed[i];
      if (one.failed[i] > 0) line += fmt::format(" {} {}", chains::kMutationFailures[i], one.failed[i]);
    }
    EXPECT_LE(one.accepted + failed, one.proposed) << one.name;
  }
  std::printf("%s %g:%s\n", sweep.name.c_str(), value, line.c_str());
}

// Claim: mlt with all mutations, and erpt, reject no sample and have no value that is none, at grazing and
// critical angles, far from the origin, in lobes of 1e-4, with vertices that lie on each other, and in the
// short form of all other sweeps; failed mutations have their causes, and chains that found light move.
TEST(PathStates, SurviveEverySweep) {
  std::vector<Sweep> sweeps = all_sweeps();
  sweeps.push_back(coincident());
  std::set<std::string> done;
  for (const Sweep& sweep : sweeps)
    for (const Claim& claim : claims())
      for (const double value : hard_for_paths(sweep.name) ? sweep.values : sweep.thin)
        if (sweep.name != "path-length" || value < 100) check(sweep, claim, value, done);
}

}  // namespace
}  // namespace candela::stress
