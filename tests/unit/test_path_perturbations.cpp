// Claims: perturbations of paths have the densities that they say, computed from the two paths alone: bins of
// the film get as many proposals as walks of another kind find by their own densities; mutations back exist;
// nothing changes outside of what is made anew; walks along manifolds come back.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "tests/statistical/quantiles.h"
#include "tests/unit/path_walks.h"
#include "worker/mcmc/mutators/caustic.h"
#include "worker/mcmc/mutators/half_vector.h"
#include "worker/mcmc/mutators/lens.h"
#include "worker/mcmc/mutators/manifold.h"
#include "worker/scene/points/surface_points.h"
#include "worker/transport/manifold/walk.h"
#include "worker/transport/path/segment.h"

namespace candela::mcmc {
namespace {

namespace path = transport::path;
using path::Kind;

// The bound of a test; there are some ten.
constexpr double kFalseAlarm = 1e-5;

std::unique_ptr<scene::Scene> scene_of(const std::string& body) {
  scene::Scene::Options options;
  options.film_width = options.film_height = path::kFilm;
  auto scene = test::build_scene(body, {}, "", options);
  EXPECT_TRUE(scene.ok()) << scene.error().to_string();
  return std::move(scene).value();
}
MutatorContext context_of(const scene::Scene& scene) {
  MutatorContext context{scene};
  context.film_width = context.film_height = path::kFilm;
  return context;
}

// A path that a walk made, and the walk's density in the measure of contributions.
struct Found {
  PathState state;
  double density = 0;
};

std::optional<Found> found_by(const scene::Scene& scene, const path::FullPath& full,
                              path::Technique::Kind kind) {
  auto named = path::canonical(scene, full, {0.5f, 0.5f});
  if (!named) return std::nullopt;
  auto state = path_state(scene, *std::move(named));
  if (!state) return std::nullopt;
  path::Technique technique;
  technique.kind = kind;
  const double value = state->evaluation().estimator_value(technique)[1];
  const path::PathNumbers& numbers = state->evaluation().numbers();
  const double end = kind == path::Technique::Kind::next_event ? numbers.light_direct : numbers.lens_connect;
  if (!(value > 0)) return std::nullopt;
  const double density = state->contribution[1] / (value * end);
  return Found{*std::move(state), density};
}

// By flags: 'D' or 'S' for each inner vertex, from the light on.
std::string letters(const path::FullPath& path) {
  std::string out;
  for (const path::InnerVertex& v : path.inner) out += v.delta ? 'S' : 'D';
  return out;
}

// All paths of one walk from the sensor that next event estimation completes.
template <class Visit>
void eye_walk(const scene::Scene& scene, rng::Stream& stream, const std::string& flags, const Visit& visit) {
  path::walk(scene, stream, [&](const path::WalkedPath& walked) {
    if (letters(walked.path) != flags) return;
    if (auto found = found_by(scene, walked.path, path::Technique::Kind::next_event))
      visit(*std::move(found));
  });
}

// One walk from the light, connected to the sensor.
template <class Visit>
void light_walk(const scene::Scene& scene, rng::Stream& stream, const std::string& flags,
                const Visit& visit) {
  const auto next_2d = [&] {
    const float u = stream.next_float();
    return Vec2{u, stream.next_float()};
  };
  scene::EmissionSample light;
  const float u_select = stream.next_float();
  const Vec2 place = next_2d();
  if (!scene.sample_emission(u_select, place, next_2d(), light)) return;
  path::FullPath full;
  full.light = light.vertex;
  full.light_delta_position = true;
  Ray ray = light.ray;
  while (full.inner.size() < flags.size()) {
    path::InnerVertex v;
    if (!scene.intersect(ray, v.hit)) return;
    full.along.push_back(ray.direction);
    scene::ClosureArena arena;
    const Vec3 wo = v.hit.shading.to_local(-ray.direction);
    const scene::Closure closure = scene.closure(v.hit, wo, arena);
    if (full.inner.size() + 1 == flags.size()) {
      full.inner.push_back(v);
      scene::CameraSample camera;
      if (flags.back() != 'D' || !scene.sample_camera(v.hit, {0.5f, 0.5f}, camera)) return;
      full.along.push_back(camera.wi);
      break;
    }
    scene::BsdfSample sample;
    const float u_lobe = stream.next_float();
    if (!closure.sample(wo, u_lobe, next_2d(), scene::TransportMode::importance, sample)) return;
    v.delta = sample.delta;
    full.inner.push_back(v);
    ray = spawn_ray(v.hit, v.hit.shading.to_world(sample.wi));
  }
  if (letters(full) != flags) return;
  if (auto found = found_by(scene, full, path::Technique::Kind::light_image)) visit(*std::move(found));
}

struct Walks {
  std::string flags;
  bool from_light = false;
  template <class Visit>
  void operator()(const scene::Scene& scene, rng::Stream& stream, const Visit& visit) const {
    if (from_light)
      light_walk(scene, stream, flags, visit);
    else
      eye_walk(scene, stream, flags, visit);
  }
};

// Bins around the film position of a path: rings between quantiles of the distance, in sectors.
struct Bins {
  static constexpr std::size_t kRings = 2, kSectors = 4, kCount = kRings * kSectors;
  double x = 0, y = 0;
  std::array<double, kRings + 1> radii{};

  std::optional<std::size_t> of(const PathState& state) const {
    const double dx = static_cast<double>(state.assembled().film.x) - x,
                 dy = static_cast<double>(state.assembled().film.y) - y, r = std::hypot(dx, dy);
    if (!(r >= radii.front() && r < radii.back())) return std::nullopt;
    const auto ring =
        static_cast<std::size_t>(std::upper_bound(radii.begin(), radii.end(), r) - radii.begin() - 1);
    const double turn = (std::atan2(dy, dx) / (2 * std::numbers::pi) + 0.5) * kSectors;
    return ring * kSectors + std::min(static_cast<std::size_t>(turn), kSectors - 1);
  }
};

bool same_flags(const path::Path& a, const path::Path& b) {
  return differ_within(a, b, 0, a.vertices.size());
}

struct Counted {
  double p = 0;  // of chi-squared
  int bins = 0, proposals = 0;
  std::array<int, kMutationFailures> failed{};
};

// Proposals from the path, binned, against the integral of T over the bins by walks.
Counted compare(const scene::Scene& scene, const PathMutator& mutator, const PathState& from,
                const Walks& walks, std::uint64_t seed, int proposals, int walked) {
  Counted out;
  rng::Stream stream(rng::key(46, seed));
  Bins bins;
  bins.x = static_cast<double>(from.assembled().film.x);
  bins.y = static_cast<double>(from.assembled().film.y);
  std::vector<double> distances;
  std::array<double, Bins::kCount> count{}, sum{}, squares{};
  std::array<int, Bins::kCount> hits{};
  for (int n = 0; n < proposals + 500; ++n) {
    const auto made = mutator.propose(from, stream);
    if (!made) {
      ++out.failed[static_cast<std::size_t>(made.failure())];
      continue;
    }
    EXPECT_TRUE(same_flags(from.path, *made));
    EXPECT_EQ(made->vertices.back(), from.path.vertices.back());
    const auto to = path_state(scene, *made);
    if (!to) continue;
    if (n < 500) {
      distances.push_back(film_distance(from, *to));
      // Every mutation has a density, and one back.
      const auto forward = mutator.log_pdf_area(from, *to), back = mutator.log_pdf_area(*to, from);
      EXPECT_TRUE(forward && std::isfinite(*forward));
      EXPECT_TRUE(mutator.suitability(*to) == mutator.suitability(from));
      if (mutator.name() != "caustic") {
        EXPECT_TRUE(back && std::isfinite(*back));
      }
      continue;
    }
    if (distances.size() < 50) return out;
    if (n == 500 || bins.radii.back() == 0) {
      std::sort(distances.begin(), distances.end());
      for (std::size_t i = 0; i <= Bins::kRings; ++i)
        bins.radii[i] = distances[(distances.size() - 1) * (40 + 27 * i) / 100];
    }
    ++out.proposals;
    if (const auto bin = bins.of(*to)) ++count[*bin];
  }
  for (int n = 0; n < walked; ++n)
    walks(scene, stream, [&](const Found& found) {
      if (!same_flags(from.path, found.state.path)) return;
      const auto bin = bins.of(found.state);
      if (!bin) return;
      const auto density = mutator.log_pdf_area(from, found.state);
      if (!density) return;
      const double weight = std::exp(*density) / found.density;
      sum[*bin] += weight;
      squares[*bin] += weight * weight;
      ++hits[*bin];
    });
  double statistic = 0;
  for (std::size_t i = 0; i < Bins::kCount; ++i) {
    if (count[i] < 40 || hits[i] < 40) continue;
    const double p = count[i] / proposals, integral = sum[i] / walked;
    const double variance = p * (1 - p) / proposals + (squares[i] / walked - integral * integral) / walked;
    statistic += (p - integral) * (p - integral) / variance;
    ++out.bins;
  }
  out.p = statistical::chi_squared_tail(statistic, out.bins);
  return out;
}

void check(const std::string& body, const Walks& walks, const auto& make, std::uint64_t seed, int paths,
           int proposals, int walked) {
  const auto scene = scene_of(body);
  const MutatorContext context = context_of(*scene);
  const auto mutator = make(context);
  rng::Stream stream(rng::key(46, seed));
  std::vector<PathState> states;
  for (int n = 0; n < 20000 && states.size() < 12; ++n)
    walks(*scene, stream, [&](Found found) {
      if (mutator.suitability(found.state) > 0) states.push_back(std::move(found.state));
    });
  int checked = 0;
  for (const PathState& from : states) {
    if (checked == paths) break;
    const Counted counted = compare(*scene, mutator, from, walks, seed + 1, proposals, walked);
    if (counted.bins < 4) continue;
    ++checked;
    EXPECT_GT(counted.p, kFalseAlarm) << counted.bins << " bins, " << counted.proposals << " proposals";
    testing::Test::RecordProperty("p", std::to_string(counted.p));
  }
  EXPECT_EQ(checked, paths) << states.size();
}

std::string matt(const std::string& moves) {
  return "<shape type='rectangle'><transform name='to_world'><scale value='4'/>" + moves +
         "</transform><bsdf type='twosided'><bsdf type='diffuse'/></bsdf></shape>";
}
const std::string kWall =
    matt("<translate z='5'/>") + matt("<rotate x='1' angle='-90'/><translate y='-1.4' z='3'/>");
std::string point(const std::string& place) {
  return "<emitter type='point'><point name='position' " + place + "/></emitter>";
}
std::string spot(const std::string& from, const std::string& to, const std::string& angle) {
  return "<emitter type='spot'><transform name='to_world'><lookat origin='" + from + "' target='" + to +
         "' up='0.1, 0.2, 1'/></transform><float name='cutoff_angle' value='" + angle + "'/></emitter>";
}
const std::string kBall =
    "<shape type='sphere'><point name='center' x='0' y='0' z='3'/><float name='radius' value='0.9'/>"
    "<bsdf type='dielectric'/></shape>";
std::string pane(const std::string& moves) {
  return "<shape type='cube'><transform name='to_world'><scale x='1.5' y='1.5' z='0.15'/>" + moves +
         "</transform><bsdf type='dielectric'/></shape>";
}
const std::string kWater =
    "<shape type='rectangle'><transform name='to_world'><scale value='4'/><rotate x='1' angle='-80'/>"
    "<translate y='1.3' z='3'/></transform><bsdf type='dielectric'/></shape>";
// A mirror at the side, and a ball of it.
const std::string kMirror =
    "<shape type='rectangle'><transform name='to_world'><scale value='4'/><rotate y='1' angle='-90'/>"
    "<translate x='1.6' z='3'/></transform><bsdf type='twosided'><bsdf type='conductor'/></bsdf></shape>";
const std::string kMirrorBall =
    "<shape type='sphere'><point name='center' x='0.9' y='-0.4' z='3.2'/><float name='radius' value='0.6'/>"
    "<bsdf type='conductor'/></shape>";

TEST(LensMutator, HasTheDensityOfItsProposals) {
  const auto make = [](const MutatorContext& context) { return LensMutator(context, {false, {0.2, 4}}); };
  check(kWall + kBall + point("x='2' y='1' z='4'"), {"DSS"}, make, 400, 2, 6000, 25000);
}

TEST(LensMutator, NeedsADiffuseNeighborOfItsEnd) {
  const auto scene = scene_of(kWall + kMirror + point("x='0' y='1.5' z='1'"));
  const LensMutator lens(context_of(*scene), {false, {0.2, 4}}),
      multichain(context_of(*scene), {true, {0.2, 4}});
  rng::Stream stream(rng::key(46, 410));
  int both = 0;
  for (int n = 0; n < 3000; ++n)
    for (const std::string flags : {"D", "DD", "DS", "DSD"})
      eye_walk(*scene, stream, flags, [&](const Found& found) {
        EXPECT_EQ(lens.suitability(found.state), flags == "DSD" ? 0 : 1);
        EXPECT_EQ(multichain.suitability(found.state), flags == "DSD" ? 1 : 0);
        ++both;
      });
  EXPECT_GT(both, 100);
}

TEST(CausticMutator, HasTheDensityOfItsProposals) {
  const auto make = [](const MutatorContext& context) { return CausticMutator(context, {0.4, 6}); };
  {
    SCOPED_TRACE("a ball");
    check(kWall + kBall + spot("0.5, 2.5, 1", "0, 0, 3", "20"), {"SSD", true}, make, 420, 1, 6000, 40000);
  }
  {
    // A ball or a pane bends light back when it leaves them: their factors cancel.
    SCOPED_TRACE("under water");
    check(kWall + kWater + spot("0.3, 2.5, 2", "0, 0, 3.5", "30"), {"SD", true}, make, 425, 2, 6000, 25000);
  }
}

TEST(MultichainMutator, HasTheDensityOfItsProposals) {
  const auto make = [](const MutatorContext& context) {
    return LensMutator(context, {true, {2, 6}, {0.2, 1}});
  };
  check(kWall + kMirror + point("x='0' y='1.5' z='1'"), {"DSD"}, make, 430, 2, 6000, 400000);
}

TEST(ManifoldMutator, HasTheDensityOfItsProposals) {
  const auto make = [](const MutatorContext& context) { return ManifoldMutator(context, 3); };
  {
    SCOPED_TRACE("a mirror ball towards the light");
    check(kWall + kMirrorBall + spot("-0.8, 1.5, 2", "0.6, -0.2, 3.1", "15"), {"SD", true}, make, 440, 2,
          6000, 40000);
  }
  {
    SCOPED_TRACE("a pane towards the light");
    check(kWall + pane("<rotate x='1' angle='75'/><translate y='1' z='3.2'/>") +
              spot("0.3, 2.5, 3", "0, 0, 3", "30"),
          {"SSD", true}, make, 450, 2, 6000, 40000);
  }
  {
    SCOPED_TRACE("a pane towards the sensor");
    check(kWall + pane("<rotate y='1' angle='20'/><translate z='1.8'/>") + point("x='0.5' y='2' z='3.5'"),
          {"DSS"}, make, 460, 2, 6000, 25000);
  }
}

// Their specular vertices, too, have the densities that belong to the path's contribution.
TEST(HalfVectorMutators, HaveTheDensityOfTheirProposalsThroughGlass) {
  const auto make = [](const MutatorContext& context) {
    return HalfVectorMutator(context.scene, {false, {1, 4}});
  };
  check(kWall + kWater + spot("0.3, 2.5, 2", "0, 0, 3.5", "30"), {"SD", true}, make, 480, 2, 6000, 25000);
}

// Over facets a walk from X may come to a path from which no walk comes back to X.
TEST(ManifoldMutator, ComesBack) {
  std::string facets = "<bsdf type='twosided' id='mirror'><bsdf type='conductor'/></bsdf>";
  rng::Stream tilts(rng::key(46, 470));
  for (int x = -2; x <= 2; ++x)
    for (int y = -2; y <= 2; ++y)
      facets += fmt::format(
          "<shape type='rectangle'><transform name='to_world'><scale value='0.15'/><rotate x='1' "
          "angle='{}'/><rotate y='1' angle='{}'/><translate x='{}' y='{}' z='4'/></transform>"
          "<ref id='mirror'/></shape>",
          20 * tilts.next_double() - 10, 180 + 20 * tilts.next_double() - 10, 0.3 * x, 0.3 * y);
  const auto scene = scene_of(matt("<rotate x='1' angle='-90'/><translate y='-1.4' z='3'/>") + facets +
                              spot("0.4, 1.8, 2", "0, 0, 4", "15"));
  const ManifoldMutator mutator(context_of(*scene), 4);
  rng::Stream stream(rng::key(46, 471));
  int came_back = 0, one_way = 0;
  for (int n = 0; n < 3000; ++n)
    light_walk(*scene, stream, "SD", [&](const Found& found) {
      const PathState& from = found.state;
      for (int m = 0; m < 20; ++m) {
        const auto made = mutator.propose(from, stream);
        one_way += !made && made.failure() == MutationFailure::no_return;
        const auto to = made ? path_state(*scene, *made) : std::nullopt;
        if (!to) continue;
        path::Segment segment;
        ASSERT_EQ(path::make_segment(*scene, to->path, to->assembled(), 0, 2, segment),
                  path::NoSegment::none);
        transport::manifold::Chain chain = segment.chain;
        ASSERT_TRUE(path::set_end_surface(*scene, from.path.vertices[2].point, chain.vertices[2]));
        const std::array<transport::manifold::Pair, 1> held{};
        const std::array<double, 1> near{1e-9};
        const path::SceneSurfaces surfaces(*scene, segment);
        ASSERT_TRUE(transport::manifold::walk(chain, held, near, surfaces, {}).converged());
        const Vec3d place = scene->points().at(from.path.vertices[1].point).p;
        ASSERT_LT(length(chain.vertices[1].x - place), 1e-4);
        ++came_back;
      }
    });
  EXPECT_GT(came_back, 300);
  EXPECT_GT(one_way, 10);
}

}  // namespace
}  // namespace candela::mcmc
