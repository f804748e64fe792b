// Claims: paths with vertices in media have the densities that mutations say, computed from paths alone;
// mutations whose stretch has such a vertex do not suit; a chain of them goes through bytes, and copies what
// it shares with the state before, bit for bit.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "tests/unit/path_walks.h"
#include "worker/mcmc/mutators/bidirectional.h"
#include "worker/mcmc/mutators/caustic.h"
#include "worker/mcmc/mutators/half_vector.h"
#include "worker/mcmc/mutators/lens.h"
#include "worker/mcmc/mutators/manifold.h"
#include "worker/mcmc/path_space.h"
#include "worker/scene/points/surface_points.h"

namespace candela::mcmc::in_fog {
namespace {

namespace path = transport::path;
using path::Kind;

// A block of colored fog in the room; a ball of glass is in it in part.
const std::string kFog =
    "<shape type='cube'><transform name='to_world'><scale x='1.4' y='1.2' z='1.1'/><translate z='3'/>"
    "</transform><bsdf type='null'/><medium type='homogeneous' name='interior'><rgb name='sigma_t' "
    "value='0.4, 0.7, 1.1'/><rgb name='albedo' value='0.9, 0.8, 0.6'/><phase type='hg'><float name='g' "
    "value='0.4'/></phase></medium></shape>";

std::unique_ptr<scene::Scene> foggy(path::Case c) {
  c.lamp += kFog;
  return path::scene_of(c);
}
MutatorContext context(const scene::Scene& scene) {
  return {scene, path::kFilm, path::kFilm, 0, 2, 5};
}
std::vector<MutatorShare> shares() {
  return {{&mutators().front(), 1.0}};
}
bool in_medium(const path::PathVertex& v) {
  return v.kind == Kind::medium;
}

// States of independent paths whose inner vertices have these letters, from the light on: M in a medium, D
// on a surface.
std::vector<PathState> states(PathSpace& space, const std::string& letters, std::size_t count) {
  std::vector<PathState> found;
  SplatList list;
  for (std::uint64_t key = 0; key < 200000 && found.size() < count; ++key) {
    space.start(rng::key(46, 500, key), list);
    if (!(list.scalar() > 0)) continue;
    std::string named;
    for (const path::PathVertex& v : space.present()->path.vertices)
      if (!path::is_light(v.kind) && v.kind != Kind::sensor)
        named += in_medium(v) ? 'M' : v.delta ? 'S' : 'D';
    if (named == letters) found.push_back(*space.present());
  }
  return found;
}

// All techniques that can make paths with a vertex in a medium have the same mean of f over their density.
TEST(PathMedia, TechniquesAgree) {
  for (const path::Case& c : path::cases()) {
    if (c.name == "two lamps" || c.name == "directional") continue;  // too few techniques
    SCOPED_TRACE(c.name);
    const auto scene = foggy(c);
    const MutatorContext of = context(*scene);
    const Subpaths subpaths(of);
    for (const std::size_t count : {3u, 4u}) {
      SCOPED_TRACE(count);
      const Subpaths::Choices all = subpaths.choices({}, count);
      std::vector<double> means, errors;
      for (std::size_t s = all.first; s < all.first + all.count; ++s) {
        rng::Stream stream(rng::key(46, 510, count, s));
        double sum = 0, squares = 0;
        constexpr int kSamples = 20000;
        for (int n = 0; n < kSamples; ++n) {
          const Proposal made = subpaths.make(nullptr, {}, count, s, stream);
          if (!made || std::ranges::none_of(made->vertices, in_medium) ||
              std::ranges::any_of(made->vertices, [](const path::PathVertex& v) { return v.delta; }))
            continue;
          const auto state = path_state(*scene, *made, of.rules());
          if (!state) continue;
          const double x = state->scalar / std::exp(subpaths.log_pdf_area(*state, {}, s));
          sum += x;
          squares += x * x;
        }
        const double mean = sum / kSamples;
        means.push_back(mean);
        errors.push_back(std::sqrt((squares / kSamples - mean * mean) / kSamples));
      }
      std::size_t best = 0, known = 0;
      for (std::size_t i = 0; i < means.size(); ++i)
        if (means[i] > 0 && !(errors[best] / means[best] < errors[i] / means[i])) best = i;
      for (std::size_t i = 0; i < means.size(); ++i) {
        if (!(means[i] > 0) || errors[i] > 0.1 * means[i]) continue;
        ++known;
        EXPECT_NEAR(means[i], means[best], 4.5 * std::hypot(errors[i], errors[best])) << i;
      }
      EXPECT_GE(known, 2u);
    }
  }
}

// A box of places for one vertex of a path, in cells: of a triangle's parameters, or of space.
struct Places {
  static constexpr std::size_t kBins = 3;
  static constexpr std::size_t kCells = kBins * kBins * kBins;
  PathState from;
  std::size_t i = 0;  // of the vertex
  Vec3d low, size;    // of space; not read of a triangle

  bool in_space() const { return in_medium(from.path.vertices[i]); }
  Vec3d at(const path::PathVertex& v) const {
    return in_space() ? Vec3d((v.place.x - low.x) / size.x, (v.place.y - low.y) / size.y,
                              (v.place.z - low.z) / size.z)
                      : Vec3d(v.point.u, v.point.v, 0);
  }
  // Nothing: the path differs in another vertex, or the place is not in the box.
  std::optional<std::size_t> cell(const path::Path& to) const {
    if (to.vertices.size() != from.path.vertices.size()) return std::nullopt;
    path::Path same = to;
    same.vertices[i] = from.path.vertices[i];
    const path::PathVertex &v = to.vertices[i], &w = from.path.vertices[i];
    if (!(same == from.path) || v.kind != w.kind || v.delta) return std::nullopt;
    if (!in_space() && (v.point.primitive != w.point.primitive || v.point.kind != w.point.kind ||
                        v.point.instance != w.point.instance))
      return std::nullopt;
    const Vec3d p = at(v);
    std::size_t cell = 0;
    for (int axis = 0; axis < 3; ++axis) {
      if (!(p[axis] >= 0 && p[axis] < 1)) return std::nullopt;
      cell = cell * kBins + static_cast<std::size_t>(p[axis] * kBins);
    }
    return cell;
  }
  // The integral of T over the cells.
  std::array<double, kCells> integral(const scene::Scene& scene, const MutatorContext& of,
                                      const PathMutator& mutator) const {
    std::array<double, kCells> cells{};
    const int steps = in_space() ? 27 : 96, deep = in_space() ? steps : 1;
    const double step = 1.0 / steps;
    for (int a = 0; a < steps; ++a)
      for (int b = 0; b < steps; ++b)
        for (int c = 0; c < deep; ++c) {
          path::Path to = from.path;
          path::PathVertex& v = to.vertices[i];
          double volume = step * step;
          if (in_space()) {
            v.place =
                low + Vec3d(size.x * (a + 0.5) * step, size.y * (b + 0.5) * step, size.z * (c + 0.5) * step);
            volume *= step * size.x * size.y * size.z;
          } else {
            v.point.u = (a + 0.5) * step;
            v.point.v = (b + 0.5) * step;
            if (v.point.u + v.point.v >= 1) continue;
            const scene::SurfaceGeometry at = scene.points().at(v.point);
            volume *= length(cross(at.dp_du, at.dp_dv));
          }
          const auto state = path_state(scene, to, of.rules());
          const auto found = cell(to);
          if (!state || !found) continue;
          if (const auto density = mutator.log_pdf_area(from, *state))
            cells[*found] += std::exp(*density) * volume;
        }
    return cells;
  }
};

// Proposals that move the vertex alone, against the integral of their density. False: too few cells have any.
bool check(const scene::Scene& scene, const PathMutator& mutator, const Places& places, std::uint64_t seed) {
  const MutatorContext of = context(scene);
  constexpr int kProposals = 60000;
  const auto expected = places.integral(scene, of, mutator);
  if (std::ranges::count_if(expected, [](double x) { return x * kProposals > 40; }) < 4) return false;
  rng::Stream stream(rng::key(46, 520, seed));
  std::array<double, Places::kCells> counted{};
  for (int n = 0; n < kProposals; ++n) {
    const Proposal to = mutator.propose(places.from, stream);
    if (!to) continue;
    const auto cell = places.cell(*to);
    if (cell && path_state(scene, *to, of.rules())) ++counted[*cell];
  }
  double chi2 = 0, cells = 0;
  for (std::size_t c = 0; c < counted.size(); ++c) {
    const double mean = expected[c] * kProposals;
    if (mean < 20) continue;
    // The integral is known to 2 %, but for edges of shadows.
    chi2 += (counted[c] - mean) * (counted[c] - mean) / (mean + 4e-4 * mean * mean);
    ++cells;
  }
  EXPECT_LT(chi2, cells + 5 * std::sqrt(2 * cells) + 5) << cells << " cells";
  return true;
}

using Make = std::function<std::unique_ptr<PathMutator>(const MutatorContext&)>;

// Vertex i of paths with these letters.
void check_paths(const std::string& letters, std::size_t i, const Make& make, std::uint64_t seed) {
  for (const std::size_t which : {0u, 4u}) {
    const path::Case c = path::cases()[which];
    SCOPED_TRACE(c.name + " " + letters);
    const auto scene = foggy(c);
    PathSpace space(context(*scene), shares());
    const auto mutator = make(context(*scene));
    int tested = 0;
    for (const PathState& from : states(space, letters, 80)) {
      if (tested == 2) break;
      if (!(mutator->suitability(from) > 0)) continue;
      const path::PathVertex& v = from.path.vertices[i];
      if (!in_medium(v) && scene->points().hit(v.point).barycentric.x == 0) continue;
      tested += check(*scene, *mutator, {from, i, {-1.4, -1.2, 1.9}, {2.8, 2.4, 2.2}}, ++seed);
    }
    EXPECT_EQ(tested, 2);
  }
}

TEST(PathMedia, BidirectionalMutationsHaveTheirDensity) {
  const Make make = [](const MutatorContext& of) { return std::make_unique<BidirectionalMutator>(of); };
  check_paths("M", 1, make, 100);
  check_paths("MD", 1, make, 200);  // the vertex beside the light
  check_paths("DM", 2, make, 300);  // the one beside the sensor
  check_paths("MD", 2, make, 400);  // a walk goes on from a place in the fog
}

// Sectors of a ring around the film position of a path.
struct Ring {
  static constexpr std::size_t kSectors = 4;
  static constexpr double kInner = 1, kOuter = 4;  // pixels

  static std::optional<std::size_t> sector(const transport::FilmPosition& of,
                                           const transport::FilmPosition& at) {
    const double x = static_cast<double>(at.x - of.x), y = static_cast<double>(at.y - of.y),
                 r = std::hypot(x, y);
    if (!(r > kInner && r < kOuter)) return std::nullopt;
    return static_cast<std::size_t>(x > 0) * 2 + static_cast<std::size_t>(y > 0);
  }
};

// The mean of 1 / T over proposals in a sector is the area on the surface of vertex i that they may lie in.
// False: they do not fill the sectors.
bool fills_its_area(const scene::Scene& scene, const PathMutator& mutator, const Places& places,
                    std::uint64_t seed) {
  const MutatorContext of = context(scene);
  const PathState& from = places.from;
  constexpr int kProposals = 20000, kSteps = 120;
  std::array<double, Ring::kSectors> sum{}, squares{}, count{}, area{};
  double low_u = 1, high_u = 0, low_v = 1, high_v = 0;
  rng::Stream stream(rng::key(46, 520, seed));
  for (int n = 0; n < kProposals; ++n) {
    const Proposal to = mutator.propose(from, stream);
    if (!to || !places.cell(*to)) continue;
    const auto state = path_state(scene, *to, of.rules());
    if (!state) continue;
    const auto sector = Ring::sector(from.assembled().film, state->assembled().film);
    if (!sector) continue;
    const auto forward = mutator.log_pdf_area(from, *state), back = mutator.log_pdf_area(*state, from);
    EXPECT_TRUE(forward.has_value());
    EXPECT_TRUE(back.has_value() || mutator.name() == "caustic");
    if (!forward) continue;
    const scene::CanonicalPoint& point = to->vertices[places.i].point;
    low_u = std::min(low_u, point.u);
    high_u = std::max(high_u, point.u);
    low_v = std::min(low_v, point.v);
    high_v = std::max(high_v, point.v);
    const double x = std::exp(-*forward);
    sum[*sector] += x;
    squares[*sector] += x * x;
    ++count[*sector];
  }
  if (std::ranges::any_of(count, [](double hits) { return hits < 300; })) return false;
  const double step_u = (high_u - low_u) * 1.1 / kSteps, step_v = (high_v - low_v) * 1.1 / kSteps;
  for (int a = 0; a < kSteps; ++a)
    for (int b = 0; b < kSteps; ++b) {
      path::Path to = from.path;
      scene::CanonicalPoint& point = to.vertices[places.i].point;
      point.u = low_u + (a + 0.5) * step_u - 0.05 * (high_u - low_u);
      point.v = low_v + (b + 0.5) * step_v - 0.05 * (high_v - low_v);
      if (point.u < 0 || point.v < 0 || point.u + point.v >= 1) continue;
      const auto state = path_state(scene, to, of.rules());
      if (!state) continue;
      const auto sector = Ring::sector(from.assembled().film, state->assembled().film);
      if (!sector || !mutator.log_pdf_area(from, *state)) continue;
      const scene::SurfaceGeometry at = scene.points().at(point);
      area[*sector] += length(cross(at.dp_du, at.dp_dv)) * step_u * step_v;
    }
  for (std::size_t i = 0; i < Ring::kSectors; ++i) {
    const double mean = sum[i] / kProposals,
                 error = std::sqrt((squares[i] / kProposals - mean * mean) / kProposals);
    EXPECT_LT(error, 0.06 * area[i]);
    EXPECT_NEAR(mean, area[i], 4.5 * error + 0.02 * area[i]);
  }
  return true;
}

// The vertex beside the sensor is on a surface, the next one in the fog.
TEST(PathMedia, PerturbationsHaveTheirDensity) {
  const std::vector<Make> all = {
      [](const MutatorContext& of) {
        return std::make_unique<LensMutator>(of, LensRules{false, {0.5, 6}});
      },
      [](const MutatorContext& of) {
        return std::make_unique<CausticMutator>(of, LogStep{0.5, 8});
      },
      [](const MutatorContext& of) { return std::make_unique<ManifoldMutator>(of, 3); }};
  const auto scene = foggy(path::cases()[0]);
  PathSpace space(context(*scene), shares());
  const std::vector<PathState> found = states(space, "MD", 60);
  std::uint64_t seed = 500;
  for (const Make& make : all) {
    const auto mutator = make(context(*scene));
    SCOPED_TRACE(std::string(mutator->name()));
    int tested = 0;
    for (const PathState& from : found) {
      if (tested == 2) break;
      if (!(mutator->suitability(from) > 0) ||
          scene->points().hit(from.path.vertices[2].point).barycentric.x == 0)
        continue;
      tested += fills_its_area(*scene, *mutator, {from, 2, {}, {}}, ++seed);
    }
    EXPECT_EQ(tested, 2);
  }
}

// Rays of these mutations would have to stop in the fog, and constraints have no surface there.
TEST(PathMedia, SomeMutationsDoNotSuit) {
  const auto scene = foggy(path::cases()[0]);
  const MutatorContext of = context(*scene);
  PathSpace space(of, shares());
  const LensMutator lens(of, {false, {0.2, 6}});
  const CausticMutator caustic(of, {0.4, 6});
  const ManifoldMutator manifold(of, 3);
  const HalfVectorMutator whole(*scene, {false, {0.1, 1}}), segments(*scene, {false, {0.1, 1}, true});
  const BidirectionalMutator bidirectional(of);
  for (const std::string letters : {"M", "DM", "MM", "MD", "DD"}) {
    SCOPED_TRACE(letters);
    const bool ends_in_fog = letters.back() == 'M', has_fog = letters.find('M') != std::string::npos;
    const auto found = states(space, letters, 5);
    EXPECT_EQ(found.size(), 5u);
    for (const PathState& state : found) {
      EXPECT_EQ(lens.suitability(state), ends_in_fog ? 0 : 1);
      EXPECT_EQ(caustic.suitability(state), ends_in_fog ? 0 : 1);
      EXPECT_EQ(manifold.suitability(state), letters == "M" || letters == "MM" ? 0 : 1);
      EXPECT_EQ(bidirectional.suitability(state), 1);
      if (!has_fog) continue;
      EXPECT_EQ(whole.suitability(state), 0);
      EXPECT_EQ(segments.suitability(state), 0);
    }
  }
}

TEST(PathMedia, MutationsCanBeUndone) {
  for (const std::size_t which : {0u, 3u, 4u, 7u}) {
    const auto scene = foggy(path::cases()[which]);
    SCOPED_TRACE(path::cases()[which].name);
    const MutatorContext of = context(*scene);
    PathSpace space(of, shares());
    const BidirectionalMutator mutator(of);
    rng::Stream stream(rng::key(46, 530));
    int lit = 0, back = 0, shared = 0;
    for (const std::string letters : {"M", "MD", "DM", "MM", "DMD"})
      for (const PathState& from : states(space, letters, 20))
        for (int n = 0; n < 20; ++n) {
          const Proposal to = mutator.propose(from, stream);
          if (!to) continue;
          ASSERT_TRUE(to->well_formed());
          ASSERT_TRUE(path::exists(*scene, *to));
          const auto there = path_state(*scene, *to, of.rules());
          const auto near = path_state(*scene, *to, of.rules(), &from);
          ASSERT_EQ(there.has_value(), near.has_value());
          if (!there) continue;
          EXPECT_EQ(there->contribution, near->contribution);
          EXPECT_EQ(space.log_pdf_area(*there), space.log_pdf_area(*near));
          shared += path::changed_range(from.path, *to).begin > 0;
          ++lit;
          const auto forward = mutator.log_pdf_area(from, *there),
                     reverse = mutator.log_pdf_area(*there, from);
          EXPECT_TRUE(forward.has_value());
          back += forward.has_value() && reverse.has_value();
        }
    EXPECT_GT(lit, 100);
    EXPECT_GT(shared, 0);
    EXPECT_GE(back, lit * 9 / 10);
  }
}

TEST(PathMedia, ChainsGoThroughBytesWithoutAChange) {
  const auto scene = foggy(path::cases()[1]);
  PathSpace whole(context(*scene), shares()), resumed(context(*scene), shares());
  SplatList list, again;
  std::uint64_t key = 0;
  do whole.start(rng::key(46, 540, key++), list);
  while (!(list.scalar() > 0) || std::ranges::none_of(whole.present()->path.vertices, in_medium));
  double scalar = list.scalar();
  int fogs = 0;
  for (std::uint64_t i = 0; i < 400; ++i) {
    const bool has = std::ranges::any_of(whole.present()->path.vertices, in_medium);
    fogs += has;
    ASSERT_TRUE(resumed.restore(whole.save(), again).ok());
    const Mutation mutation{rng::key(46, 541, i), i % 5 == 0};
    const double ratio = whole.propose(mutation, list);
    EXPECT_EQ(ratio, resumed.propose(mutation, again));
    EXPECT_EQ(list.scalar(), again.scalar());
    resumed.reject();
    rng::Stream decide(rng::key(46, 542, i));
    const double accept = list.scalar() > 0 ? std::min(1.0, ratio * list.scalar() / scalar) : 0;
    if (decide.next_double() < accept) {
      whole.accept();
      scalar = list.scalar();
    } else {
      whole.reject();
    }
  }
  EXPECT_GT(fogs, 40);
}

}  // namespace
}  // namespace candela::mcmc::in_fog
