// Claim: mutations of paths that have a mollified vertex have the densities that they say, on surfaces with
// diffuse and delta lobes in one bsdf, and between mirrors, glass and rough metal.
//
// Let X be an independent path, of the density p, Y what a mutation makes of X, and q the quotient
// T(Y -> X) p(Y) / (T(X -> Y) p(X)) by the densities that the mutation says. Then E[min(1, q) (h(Y) - h(X))]
// is 0 for every function h of paths [Hastings 1970]: as much goes into a set of paths as comes out of it. A
// density or probability that is left out for some kind of vertex shows in the sets of such paths. The light
// of the paths is not in it: few paths have most of that, and tails of its mean would hide an error.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/long_form.h"
#include "tests/statistical/moments.h"
#include "tests/unit/scene_fixture.h"
#include "worker/mcmc/path_space.h"

namespace candela::mcmc {
namespace {

constexpr std::uint32_t kSide = 16;

const std::string kCamera =
    R"(<sensor type="perspective"><float name="fov" value="50"/><transform name="to_world"><lookat
       origin="0, -3.2, 1.4" target="0, 0, 0.5" up="0, 0, 1"/></transform></sensor>)";
const std::string kLamp =
    R"(<emitter type="point"><point name="position" x="-0.8" y="-0.5" z="1.6"/>
       <rgb name="intensity" value="6"/></emitter>)";

std::string floor_of(const std::string& bsdf) {
  return R"(<shape type="rectangle"><transform name="to_world"><scale value="2"/></transform>)" + bsdf +
         "</shape>";
}
std::string wall_of(const std::string& bsdf) {
  return R"(<shape type="rectangle"><transform name="to_world"><scale value="2"/><lookat origin="0, 1.5, 1"
       target="0, 0, 1" up="0, 0, 1"/></transform>)" +
         bsdf + "</shape>";
}
std::string ball_of(double x, const std::string& bsdf) {
  return fmt::format(
      R"(<shape type="sphere"><point name="center" x="{}" y="0.2" z="0.5"/><float name="radius" value="0.5"/>
         {}</shape>)",
      x, bsdf);
}
std::string plastic(double diffuse) {
  return fmt::format(R"(<bsdf type="plastic"><rgb name="diffuse_reflectance" value="{}"/></bsdf>)", diffuse);
}

// Every surface has a diffuse and a delta lobe.
std::string plastic_room() {
  return floor_of(plastic(0.5)) + wall_of(plastic(0.3)) + ball_of(0.3, plastic(0.4)) + kLamp;
}
// A mirror behind a ball of glass and one of rough metal.
std::string mixed_room() {
  return floor_of(R"(<bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf>)") +
         wall_of(R"(<bsdf type="conductor"><string name="material" value="none"/></bsdf>)") +
         ball_of(0.6, R"(<bsdf type="dielectric"/>)") +
         ball_of(-0.6, R"(<bsdf type="roughconductor"><float name="alpha" value="0.15"/></bsdf>)") + kLamp;
}

// A path of a chain, beside its contribution.
struct Seen {
  explicit Seen(const PathState& state)
      : edges(state.path.edge_count()),
        x(static_cast<double>(state.assembled().film.x)),
        y(static_cast<double>(state.assembled().film.y)) {
    for (const transport::path::PathVertex& v : state.path.vertices) deltas += v.delta ? 1 : 0;
    if (!state.mollified) return;
    vertex = state.mollified->vertex;
    to_light = state.mollified->cone == transport::path::Cone::towards_light;
    bsdf = state.assembled().path.inner[vertex - 1].hit.bsdf;
    place = state.assembled().places[vertex];
    length = state.assembled().edges[to_light ? vertex - 1 : vertex].length;
  }
  bool mollified() const { return vertex > 0; }

  std::size_t edges, deltas = 0, vertex = 0;
  bool to_light = false;
  std::uint32_t bsdf = 0;
  double x, y, length = 0;
  Vec3d place;
};

bool odd(double value) {
  return std::fmod(std::floor(value), 2) != 0;
}

struct Set {
  const char* name;
  bool (*has)(const Seen&);
};
// The mollified paths, and parts of them.
constexpr std::array kSets{
    Set{"mollified", [](const Seen& s) { return s.mollified(); }},
    Set{"at the first vertex", [](const Seen& s) { return s.vertex == 1; }},
    Set{"at the second vertex", [](const Seen& s) { return s.vertex == 2; }},
    Set{"towards the light", [](const Seen& s) { return s.mollified() && s.to_light; }},
    Set{"on the floor", [](const Seen& s) { return s.mollified() && s.bsdf == 0; }},
    Set{"on the wall", [](const Seen& s) { return s.mollified() && s.bsdf == 1; }},
    Set{"of two edges", [](const Seen& s) { return s.mollified() && s.edges == 2; }},
    Set{"of four edges", [](const Seen& s) { return s.mollified() && s.edges == 4; }},
    Set{"with a delta lobe", [](const Seen& s) { return s.mollified() && s.deltas > 0; }},
    Set{"over a long edge", [](const Seen& s) { return s.mollified() && s.length > 2.5; }},
    Set{"seen on the left", [](const Seen& s) { return s.mollified() && s.x < 0.5 * kSide; }},
    Set{"seen in odd columns", [](const Seen& s) { return s.mollified() && odd(s.x); }},
    Set{"seen in odd rows", [](const Seen& s) { return s.mollified() && odd(s.y); }},
    Set{"in odd bands of x", [](const Seen& s) { return s.mollified() && odd(4 * s.place.x); }},
    Set{"high above the floor", [](const Seen& s) { return s.mollified() && s.place.z > 1.1; }},
    Set{"at odd lengths", [](const Seen& s) { return s.mollified() && odd(4 * s.length); }},
};

struct Flow {
  double into = 0, out = 0, squares = 0;
  std::uint64_t starts = 0;  // from which some came
};

struct Mutated {
  std::array<Flow, kSets.size()> flows{};
  double light = 0, mollified = 0, largest = 0;  // I of the starts
};

// Mutations from each of `count` independent paths, of which some are not mollified.
Mutated mutate(PathSpace& space, std::uint64_t count, bool also_regular) {
  constexpr std::uint64_t kMutations = 16;
  Mutated out;
  SplatList from, to;
  for (std::uint64_t key = 0; key < count; ++key) {
    space.start(rng::key(45, 500, key), from);
    const double weight = from.scalar();
    if (!(weight > 0)) continue;
    const Seen was(*space.present());
    out.light += weight;
    out.mollified += was.mollified() ? weight : 0;
    out.largest = std::max(out.largest, weight);
    if (!was.mollified() && !also_regular) continue;
    std::array<double, kSets.size()> moved{}, all{};
    const std::uint64_t mutations = was.mollified() ? kMutations : 4;
    for (std::uint64_t i = 0; i < mutations; ++i) {
      if (i > 0) space.start(rng::key(45, 500, key), from);
      const double ratio = space.propose({rng::key(45, 501, key, i), false}, to);
      if (!(ratio > 0) || !(to.scalar() > 0)) {
        space.reject();
        continue;
      }
      const double accepted = std::min(1.0, ratio) / static_cast<double>(mutations);
      space.accept();
      const Seen is(*space.present());
      for (std::size_t j = 0; j < kSets.size(); ++j) {
        if (kSets[j].has(was) == kSets[j].has(is)) continue;
        moved[j] += kSets[j].has(is) ? accepted : -accepted;
        all[j] += accepted;
      }
    }
    for (std::size_t j = 0; j < kSets.size(); ++j) {
      Flow& flow = out.flows[j];
      flow.into += (all[j] + moved[j]) / 2;
      flow.out += (all[j] - moved[j]) / 2;
      flow.squares += moved[j] * moved[j];
      flow.starts += all[j] > 0 ? 1 : 0;
    }
  }
  return out;
}

std::unique_ptr<scene::Scene> scene_of(const std::string& room) {
  scene::Scene::Options options;
  options.film_width = options.film_height = kSide;
  auto scene = test::build_scene(room, {}, kCamera, options);
  if (!scene.ok()) throw std::runtime_error(scene.error().to_string());
  return std::move(*scene);
}
// Edges of the paths: with two edges most mollified paths are images of the lamp.
struct Lengths {
  std::uint32_t min, max;
};

void expect_balance(const std::string& name, PathSpace& space, std::uint64_t count, bool also_regular) {
  const Mutated moved = mutate(space, count, also_regular);
  std::printf("%s: light %.4g, mollified %.4f, largest %.0f means\n", name.c_str(),
              moved.light / static_cast<double>(count), moved.mollified / moved.light,
              moved.largest * static_cast<double>(count) / moved.light);
  for (std::size_t i = 0; i < kSets.size(); ++i) {
    const Flow& flow = moved.flows[i];
    if (flow.starts == 0) continue;
    const double error = std::sqrt(flow.squares);
    std::printf("  %-22s %6llu  in/out %.4f +- %.4f  z %+.2f\n", kSets[i].name,
                static_cast<unsigned long long>(flow.starts), flow.into / flow.out,
                2 * error / (flow.into + flow.out), (flow.into - flow.out) / error);
    // Sums of few values are not normal.
    EXPECT_NEAR(flow.into, flow.out, (flow.starts < 30 ? 20 : 5) * error) << name << ": " << kSets[i].name;
  }
}

TEST(MollifiedPaths, MutationsHaveTheirDensity) {
  std::vector<MutatorShare> all;
  for (const MutatorEntry& entry : mutators()) all.push_back({&entry, 1});
  for (const MutatorPreset& preset : mutator_presets())
    if (preset.name == "hslt")
      for (const MutatorEntry& entry : preset.mutations.subspan(3))
        all.push_back({&entry, 1});  // of segments
  for (const auto& [room, of] : {std::pair{plastic_room(), "plastic"}, {mixed_room(), "mixed"}}) {
    const auto scene = scene_of(room);
    for (const Lengths lengths : {Lengths{2, 4}, Lengths{3, 5}})
      for (const MutatorShare& one : all) {
        const bool bidirectional = one.entry == &mutators().front();
        PathSpace space({*scene, kSide, kSide, 0, lengths.min, lengths.max,
                         0.3 * static_cast<double>(scene->features().radius)},
                        {&one, 1});
        const std::uint64_t count = bidirectional ? 100000 : 20000;
        expect_balance(fmt::format("{} {}, {} to {} edges", of, one.entry->name, lengths.min, lengths.max),
                       space, test::long_form() ? 20 * count : count, bidirectional);
      }
  }
}

// Claim: independent paths bring the light that bidirectional path tracing finds with the same radius, which
// knows nothing of their densities: mollified light, and the other light of surfaces with both kinds of
// lobes.
TEST(MollifiedPaths, IndependentPathsHaveTheLightOfBdpt) {
  struct Light {
    std::string room;
    // By bdpt, regularise_layer=true; standard errors are at most 0.4 %.
    double mollified, regular;
  };
  for (const Light& one : {Light{plastic_room(), 0.011625, 0.14193}, Light{mixed_room(), 0.1842, 0.1384}}) {
    const auto scene = scene_of(one.room);
    PathSpace space({*scene, kSide, kSide, 0, 2, 4, 0.3 * static_cast<double>(scene->features().radius)}, {});
    statistical::Moments mollified, regular;
    SplatList list;
    for (std::uint64_t key = 0; key < (test::long_form() ? 4000000U : 400000U); ++key) {
      space.start(rng::key(45, 510, key), list);
      mollified.add(list.mollified_scalar());
      regular.add(list.scalar() - list.mollified_scalar());
    }
    std::printf("mollified %.4f +- %.4f, regular %.4f +- %.4f of bdpt's\n", mollified.mean() / one.mollified,
                mollified.error() / one.mollified, regular.mean() / one.regular,
                regular.error() / one.regular);
    EXPECT_NEAR(mollified.mean(), one.mollified, 5 * mollified.error() + 0.03 * one.mollified);
    EXPECT_NEAR(regular.mean(), one.regular, 5 * regular.error() + 0.01 * one.regular);
    EXPECT_LT(mollified.error(), 0.09 * one.mollified);
  }
}

}  // namespace
}  // namespace candela::mcmc
