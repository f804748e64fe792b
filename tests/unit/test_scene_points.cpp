// Samplers of points on lamps: solid angles, warps and densities against exact values, variances of single
// techniques and pairs against quadrature, and what may not break them. Seeds are fixed; means are compared
// at 4 standard errors.
//
// Rectangles are in their own axes at the distance z along their normal, the reference is the origin with a
// normal of its own, and the integrand is the cosine to it over solid angle.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "common/mis/ldlt.h"
#include "tests/mis_estimators.h"
#include "tests/random_draws.h"
#include "tests/unit/chi_squared.h"
#include "tests/unit/scene_fixture.h"
#include "worker/scene/emitters/lights.h"
#include "worker/scene/emitters/points/parallel_projection.h"
#include "worker/scene/emitters/points/spherical_rectangle.h"
#include "worker/scene/emitters/points/spherical_triangle.h"

namespace candela::scene {
namespace {

constexpr PointSampler kSamplers[] = {PointSampler::own, PointSampler::spherical, PointSampler::area,
                                      PointSampler::parallel};

struct Sides {
  double x0, x1, y0, y1, z;
};

struct Problem {
  const char* name;
  Sides sides;
  Vec3d normal;  // not unit
  double e;      // the integral
  double solid_angle;

  double size() const { return (sides.x1 - sides.x0) * (sides.y1 - sides.y0); }
  Vec3d unit_normal() const { return normalize(normal); }
  SphericalRectangle seen() const { return {sides.x0, sides.x1, sides.y0, sides.y1, sides.z}; }
  ParallelProjection projection() const {
    return {{sides.x0, sides.y0, sides.z},
            {sides.x1 - sides.x0, 0, 0},
            {0, sides.y1 - sides.y0, 0},
            sides.z * size(),
            unit_normal()};
  }
};
constexpr Problem kProblems[] = {
    {"R1", {-0.5, 1.5, -1, 0.5, 1}, {0, 0, 1}, 1.29074085276298, 1.5333982654974336},
    {"R2", {-0.5, 1.5, -1, 0.5, 1}, {0.5, 0.3, 1}, 1.1933808008795, 1.5333982654974336},
    {"R3", {-0.5, 1.5, -1, 0.5, 1}, {1, 0, 0.3}, 0.672356033234652, 1.5333982654974336},
    {"R4", {-1, 1, -1, 1, 0.2}, {0, 0, 1}, 3.04212843837004, 5.1701980162403975},
    {"R5", {-1, 1, -1, 1, 0.5}, {0.4, 0, 1}, 2.42402333495654, 3.7091808720064487},
    {"R6", {-0.05, 0.05, -0.05, 0.05, 50}, {0, 0, 1}, 3.99999466667413e-06, 3.9999960000046669e-06},
};

// Small, thin, near and grazing rectangles, whose solid angles and warps cancel in other forms.
struct Seen {
  Sides sides;
  double solid_angle;
};
constexpr Seen kHard[] = {
    {{-0.5, 0.5, -0.5, 0.5, 1}, 0.80543168316132319},
    {{-0.005, 0.005, -0.005, 0.005, 1}, 9.9997500072914323e-05},
    {{-5e-06, 5e-06, -5e-06, 5e-06, 1}, 9.9999999997500018e-11},
    {{10, 11, 10, 11, 1}, 0.00030385782576010682},
    {{-5, 5, 0.5, 0.50001, 1}, 1.5614337222330003e-05},
    {{0.1, 1.1, -0.5, 0.5, 1e-4}, 0.0016002236532119394},
    {{-1, 1, -1, 1, 1e-3}, 6.2775284552871149},
};

// Densities per solid angle at a point, in the order spherical, area, parallel.
std::array<double, 3> densities(const Problem& p, const ParallelProjection& projection, double x, double y) {
  const double r = std::sqrt(x * x + y * y + p.sides.z * p.sides.z);
  const double h = dot(p.unit_normal(), Vec3d(x, y, p.sides.z));
  return {1 / p.seen().solid_angle(), r * r * r / (p.sides.z * p.size()),
          projection.covers(h) ? r * r * r / (projection.area() * h * h * h) : 0.0};
}
double cosine(const Problem& p, double x, double y) {
  const Vec3d v(x, y, p.sides.z);
  return std::max(0.0, dot(p.unit_normal(), v) / length(v));
}
TVec2<double> draw_point(const Problem& p, const ParallelProjection& projection, std::size_t technique,
                         test::Draws& draws) {
  const double u = draws.uniform(), v = draws.uniform();
  if (technique == 0) return p.seen().sample(u, v);
  const TVec2<double> at = technique == 2 ? projection.sample(u, v) : TVec2<double>{u, v};
  return {p.sides.x0 + at.x * (p.sides.x1 - p.sides.x0), p.sides.y0 + at.y * (p.sides.y1 - p.sides.y0)};
}

// A, b and the integral of f^2 / q over solid angle, one sample of each of the techniques, by Gauss's
// quadrature of 5 points in each of 80 x 80 cells.
struct Moments {
  std::size_t n = 0;
  std::array<std::array<double, 3>, 3> a{};
  std::array<double, 3> b{};
  double second = 0;

  double balance() const {
    double v = second;
    for (std::size_t i = 0; i < n; ++i) v -= b[i] * b[i];
    return v;
  }
  std::array<double, 3> slopes() const { return mis::Ldlt<3>(a, n, 1e-10).solve(b); }
  double optimal() const {
    const auto alpha = slopes();
    double v = second;
    for (std::size_t i = 0; i < n; ++i) v -= b[i] * alpha[i];
    return v;
  }
};
Moments moments(const Problem& problem, const std::vector<std::size_t>& techniques) {
  constexpr double kNodes[] = {-0.906179845938664, -0.538469310105683, 0, 0.538469310105683,
                               0.906179845938664};
  constexpr double kWeights[] = {0.236926885056189, 0.478628670499366, 0.568888888888889, 0.478628670499366,
                                 0.236926885056189};
  constexpr int kCells = 80;
  const ParallelProjection projection = problem.projection();
  const Sides& s = problem.sides;
  const double cx = (s.x1 - s.x0) / kCells / 2, cy = (s.y1 - s.y0) / kCells / 2;
  Moments m;
  m.n = techniques.size();
  for (int i = 0; i < kCells * 5; ++i)
    for (int j = 0; j < kCells * 5; ++j) {
      const double x = s.x0 + cx * (2 * (i / 5) + 1 + kNodes[i % 5]);
      const double y = s.y0 + cy * (2 * (j / 5) + 1 + kNodes[j % 5]);
      const double r = std::sqrt(x * x + y * y + s.z * s.z);
      const double solid_angle = kWeights[i % 5] * kWeights[j % 5] * cx * cy * s.z / (r * r * r);
      const auto p = densities(problem, projection, x, y);
      const double f = cosine(problem, x, y);
      double q = 0;
      for (const std::size_t t : techniques) q += p[t];
      if (!(q > 0)) continue;
      for (std::size_t k = 0; k < m.n; ++k) {
        m.b[k] += solid_angle * f * p[techniques[k]] / q;
        for (std::size_t l = 0; l < m.n; ++l)
          m.a[k][l] += solid_angle * p[techniques[k]] * p[techniques[l]] / q;
      }
      m.second += solid_angle * f * f / q;
    }
  return m;
}

TEST(PointSamplers, SolidAnglesOfRectangles) {
  for (const Problem& p : kProblems) EXPECT_NEAR(p.seen().solid_angle() / p.solid_angle, 1, 1e-13) << p.name;
  for (const Seen& c : kHard)
    EXPECT_NEAR(
        solid_angle_of_rectangle(c.sides.x0, c.sides.x1, c.sides.y0, c.sides.y1, c.sides.z) / c.solid_angle,
        1, 1e-13)
        << c.solid_angle;
}

// Claim: the part of the solid angle beside a point is its first number, the part of its line below it the
// second.
TEST(PointSamplers, TheWarpOfRectanglesIsExact) {
  const auto part = [](const Sides& s, double x) {
    return solid_angle_of_rectangle(s.x0, x, s.y0, s.y1, s.z);
  };
  std::vector<Seen> cases(std::begin(kHard), std::end(kHard));
  for (const Problem& p : kProblems) cases.push_back({p.sides, p.solid_angle});
  for (const Seen& c : cases) {
    const Sides& s = c.sides;
    const SphericalRectangle seen(s.x0, s.x1, s.y0, s.y1, s.z);
    for (int i = 0; i <= 40; ++i)
      for (int j = 0; j <= 40; ++j) {
        const double u = i / 40.0, v = j / 40.0;
        const TVec2<double> p = seen.sample(u, v);
        ASSERT_TRUE(p.x >= s.x0 && p.x <= s.x1 && p.y >= s.y0 && p.y <= s.y1) << c.solid_angle;
        EXPECT_NEAR(part(s, p.x) / c.solid_angle, u, 1e-12) << c.solid_angle << " " << u << " " << v;
        const auto k = [&](long double y) {
          const long double x = p.x, z = s.z;
          return y / std::sqrt(x * x + y * y + z * z);
        };
        const auto share = static_cast<double>((k(p.y) - k(s.y0)) / (k(s.y1) - k(s.y0)));
        // A double's own step, where the line is far shorter than its distance.
        const double step = 0x1p-51 * std::max(std::abs(s.y0), std::abs(s.y1)) / (s.y1 - s.y0);
        EXPECT_NEAR(share, v, 1e-12 + step) << c.solid_angle << " " << u << " " << v;
      }
  }
  const SphericalRectangle r1 = kProblems[0].seen();
  const double points[][4] = {{0.25, 0.75, -0.121855851726, 0.160473185029},
                              {0.6, 0.1, 0.363057539877, -0.745501087509},
                              {0.01, 0.99, -0.482334251082, 0.484308408851}};
  for (const auto& [u, v, x, y] : points) {
    EXPECT_NEAR(r1.sample(u, v).x, x, 1e-11);
    EXPECT_NEAR(r1.sample(u, v).y, y, 1e-11);
  }
}

// Claim: the same for triangles: the flat triangle A B C' has the share u of the solid angle, and the arc
// from B to the point the share v of the cosine's range.
TEST(PointSamplers, TheWarpOfTrianglesIsExact) {
  test::Draws draws(7);
  const auto corner = [&](double size, Vec3d around) {
    return around + Vec3d(draws.uniform() - 0.5, draws.uniform() - 0.5, draws.uniform() - 0.5) * size;
  };
  for (const double size : {1e-6, 1e-3, 1.0, 30.0}) {
    for (int i = 0; i < 400; ++i) {
      const Vec3d around = normalize(Vec3d(draws.normal(), draws.normal(), draws.normal()));
      const Vec3d a = corner(size, around), b = corner(size, around), c = corner(size, around);
      const double volume = std::abs(dot(a, cross(b - a, c - a)));
      const SphericalTriangle seen(a, b, c, volume);
      ASSERT_GT(seen.solid_angle(), 0);
      const double u = draws.uniform(), v = draws.uniform();
      const TVec2<double> at = seen.sample(u, v);
      ASSERT_TRUE(at.x >= 0 && at.y >= 0 && at.x + at.y <= 1 + 1e-15) << size;
      // Slivers seen edge-on lose digits in the volume itself.
      if (volume < 1e-5 * length(b - a) * length(c - a)) continue;
      const double t = at.y / (1 - at.x);
      const Vec3d end = a + (c - a) * t, p = a * (1 - at.x - at.y) + b * at.x + c * at.y;
      EXPECT_NEAR(solid_angle_of_triangle(a, b, end, volume * t) / seen.solid_angle(), u, 1e-9) << size;
      const auto range = [&](Vec3d d) { return length_squared(normalize(d) - normalize(b)); };
      EXPECT_NEAR(range(p) / range(end), v, 1e-9 + 1e-15 / size / size) << size;
    }
  }
  // Both halves of R1.
  const Sides& s = kProblems[0].sides;
  const Vec3d c00(s.x0, s.y0, s.z), c10(s.x1, s.y0, s.z), c11(s.x1, s.y1, s.z), c01(s.x0, s.y1, s.z);
  const double volume = s.z * kProblems[0].size();
  EXPECT_NEAR(solid_angle_of_triangle(c00, c10, c11, volume) + solid_angle_of_triangle(c00, c11, c01, volume),
              kProblems[0].solid_angle, 1e-13);
}

// Claim: by quadrature, alpha, and the variances of one batch by single techniques, the balance heuristic and
// optimal weights are those of the exact table.
TEST(PointSamplers, VariancesAreThoseOfTheTable) {
  struct Row {
    std::size_t problem;
    std::vector<std::size_t> techniques;
    double balance, optimal;  // a single technique: optimal = 0, not compared
  };
  const Row rows[] = {
      {0, {0}, 0.0335440951522311, 0},
      {0, {1}, 0.638231355209276, 0},
      {0, {2}, 0.638231355209276, 0},
      {0, {0, 1}, 0.110447284415889, 0.00164192286797692},
      {0, {0, 2}, 0.110447284415889, 0.00164192286797692},
      {0, {1, 2}, 0.319115677604638, 0.319115677604638},
      {1, {0}, 0.0621814267373893, 0},
      {1, {1}, 0.461243815225848, 0},
      {1, {2}, 1.58539759445727, 0},
      {1, {0, 1}, 0.0834032517372632, 0.0309835400703611},
      {1, {0, 2}, 0.200296569935115, 0.00935830165349945},
      {1, {1, 2}, 0.347051500591056, 0.271796011945884},
      {1, {0, 1, 2}, 0.116688931283257, 0.00658991633820164},
      {3, {0}, 1.51211023058836, 0},
      {3, {1}, 95.4615633554142, 0},
      {3, {0, 1}, 2.95319252500556, 0.473106279255098},
      {3, {0, 2}, 2.95319252500556, 0.473106279255098},
      {4, {0}, 0.802039618133471, 0},
      {4, {1}, 9.02635685450944, 0},
      {4, {2}, 149.135473932505, 0},
      {4, {0, 1}, 1.17198915049605, 0.257916134512271},
      {4, {0, 2}, 1.37380540649299, 0.387852266838492},
      {4, {0, 1, 2}, 1.33156222230903, 0.201969013971209},
  };
  for (const Row& row : rows) {
    const Problem& p = kProblems[row.problem];
    const Moments m = moments(p, row.techniques);
    EXPECT_NEAR(m.balance() / row.balance, 1, 1e-8) << p.name << " " << row.techniques.size();
    if (row.optimal > 0) {
      EXPECT_NEAR(m.optimal() / row.optimal, 1, 1e-8) << p.name << " " << row.techniques.size();
    }
  }
  const auto expect_slopes = [](std::size_t problem, const std::vector<std::size_t>& techniques, double a0,
                                double a1) {
    const auto alpha = moments(kProblems[problem], techniques).slopes();
    EXPECT_NEAR(alpha[0], a0, 1e-6);
    EXPECT_NEAR(alpha[1], a1, 1e-6);
  };
  expect_slopes(0, {0, 1}, 1.619553149, -0.328812296);
  expect_slopes(1, {0, 1}, 1.272870817, -0.079490016);
  expect_slopes(1, {0, 2}, 1.438979894, -0.245599094);
  // At the horizon the projection is clipped at 0.4 of the greatest height.
  EXPECT_NEAR(moments(kProblems[2], {0, 2}).optimal(), 0.0828, 5e-4);
  EXPECT_NEAR(moments(kProblems[2], {0, 1}).optimal(), 0.0738, 1e-4);
}

// Claim: each sampler's estimates of the integral have the right mean and variance.
TEST(PointSamplers, EstimateTheIntegral) {
  constexpr int kDraws = 400000;
  const double variances[][3] = {// of one sample; 0: not compared
                                 {0.0335440951522311, 0.638231355209276, 0.638231355209276},
                                 {0.0621814267373893, 0.461243815225848, 1.58539759445727},
                                 {0.217192183804441, 0.167916725217461, 0},
                                 {1.51211023058836, 95.4615633554142, 95.4615633554142},
                                 {0.802039618133471, 9.02635685450944, 149.135473932505},
                                 {7.11107860329343e-25, 1.13777257652597e-23, 1.13777257652335e-23}};
  for (std::size_t i = 0; i < std::size(kProblems); ++i) {
    const Problem& p = kProblems[i];
    const ParallelProjection projection = p.projection();
    for (std::size_t technique = 0; technique < 3; ++technique) {
      if (variances[i][technique] == 0) continue;  // clipped: no estimate of the whole
      test::Draws draws(17 * i + technique);
      double sum = 0, squares = 0;
      for (int k = 0; k < kDraws; ++k) {
        const TVec2<double> at = draw_point(p, projection, technique, draws);
        const double excess = cosine(p, at.x, at.y) / densities(p, projection, at.x, at.y)[technique] - p.e;
        sum += excess;
        squares += excess * excess;
      }
      const double variance = squares / kDraws;
      EXPECT_LE(std::abs(sum / kDraws), 4 * std::sqrt(variance / kDraws)) << p.name << " " << technique;
      EXPECT_NEAR(variance / variances[i][technique], 1, 0.03) << p.name << " " << technique;
    }
  }
}

// Claim: of 128 batches under the tilted rectangle R2, by points in solid angle and in the parallel
// projection, crossfit has 1.02 of the optimal variance, and the right mean. 20000 runs: a standard error of
// 1 %.
TEST(PointSamplers, CrossfitIsNearlyOptimalUnderATiltedRectangle) {
  constexpr int kRuns = 20000, kBatches = 128;
  constexpr std::size_t kPair[] = {0, 2};
  const Problem& p = kProblems[1];
  const ParallelProjection projection = p.projection();
  const SphericalRectangle seen = p.seen();
  const double uniform = 1 / seen.solid_angle(), optimal = 0.00935830165349945;
  const mis::Allocation both = mis::Allocation::ones(2);
  test::Draws draws(29);
  double sum = 0, squares = 0;
  for (int run = 0; run < kRuns; ++run) {
    std::array<mis::Sums, 2> halves;
    for (int batch = 0; batch < kBatches; ++batch)
      for (const std::size_t technique : kPair) {
        const double u = draws.uniform(), v = draws.uniform();
        TVec2<double> at = technique == 0 ? seen.sample(u, v) : projection.sample(u, v);
        if (technique == 2)
          at = {p.sides.x0 + at.x * (p.sides.x1 - p.sides.x0), p.sides.y0 + at.y * (p.sides.y1 - p.sides.y0)};
        const Vec3d to(at.x, at.y, p.sides.z);
        const double r = length(to), h = dot(p.unit_normal(), to), cosine = h / r;
        const std::array<double, 2> two = {uniform, 1 / (projection.area() * cosine * cosine * cosine)};
        const mis::Controls c = mis::controls(both, two);
        halves[static_cast<std::size_t>(batch % 2)].add(2, c.c, {c.over_q(cosine), 0, 0});
      }
    const double excess = (halves[0].balance_sum(both, 0) + halves[1].balance_sum(both, 0) +
                           mis::crossfit(both, halves[0], halves[1], 40)[0]) /
                              kBatches -
                          p.e;
    sum += excess;
    squares += excess * excess;
  }
  const double variance = squares / kRuns;
  EXPECT_LE(std::abs(sum / kRuns), 4 * std::sqrt(variance / kRuns));
  std::printf("T x variance of crossfit over the optimal one, R2, T = 128: %.3f\n",
              kBatches * variance / optimal);
  EXPECT_NEAR(kBatches * variance / optimal, 1.02, 0.03);
}

// Claim: techniques that coincide give the balance heuristic's value.
TEST(PointSamplers, CoincidentTechniquesAreTheBalanceHeuristic) {
  struct Pair {
    std::size_t problem, first, second;
  };
  const mis::Allocation both = mis::Allocation::ones(2);
  for (const Pair& pair : {Pair{0, 1, 2}, Pair{5, 0, 1}, Pair{5, 0, 2}, Pair{5, 1, 2}}) {
    const Problem& p = kProblems[pair.problem];
    const ParallelProjection projection = p.projection();
    test::Draws draws(3);
    std::array<mis::Sums, 2> halves;
    for (int batch = 0; batch < 64; ++batch)
      for (const std::size_t technique : {pair.first, pair.second}) {
        const TVec2<double> at = draw_point(p, projection, technique, draws);
        const auto all = densities(p, projection, at.x, at.y);
        const std::array<double, 2> two = {all[pair.first], all[pair.second]};
        const mis::Controls c = mis::controls(both, two);
        const double f = c.over_q(cosine(p, at.x, at.y));
        halves[static_cast<std::size_t>(batch % 2)].add(2, c.c, {f, f, f});
      }
    const double balance = halves[0].balance_sum(both, 0) + halves[1].balance_sum(both, 0);
    for (const double correction :
         {mis::crossfit(both, halves[0], halves[1], 40)[0], mis::direct(both, halves, 40)[0]}) {
      ASSERT_TRUE(std::isfinite(correction));
      EXPECT_LE(std::abs(correction), 1e-9 * balance) << p.name << " " << pair.first << pair.second;
    }
  }
}

// Claim: by a chi-squared test over the lamp at 1e-6, points on rectangles and sheared ones are drawn with
// the density that is stated for them; 42 tests.
TEST(PointSamplers, PointsOnRectanglesFollowTheirDensity) {
  struct View {
    Vec3 p, front;
  };
  const View views[] = {{{0, 0, 0}, {0, 0, 1}},
                        {{0.1f, 0.2f, 1.2f}, {}},
                        {{1.5f, -1, 1.7f}, {-0.6f, 0, 0.8f}},
                        {{0.3f, -0.2f, -6}, {0.6f, 0, 0.8f}},
                        {{0.4f, 0.2f, 1.3f}, normalize(Vec3{1, 0.3f, 0.4f})},  // clips the projection
                        {{0.1f, 0.1f, 1.98f}, normalize(Vec3{0.3f, -0.2f, 1})},
                        {{3, 0.1f, 1.9f}, normalize(Vec3{-1, 0, 0.1f})}};
  constexpr std::size_t kBins = 10, kFine = 60;
  constexpr int kDraws = 40000;
  for (const double shear : {0.0, 0.3}) {
    auto scene =
        test::build_scene("<shape type=\"rectangle\">" +
                          test::matrix({0.5, shear, 0, 0.1, 0, -0.4, 0, 0.1, 0, 0, -1, 2, 0, 0, 0, 1}) +
                          "<emitter type=\"area\"/></shape>");
    ASSERT_TRUE(scene.ok()) << scene.error().to_string();
    const Lights& lights = (*scene)->lights();
    std::uint64_t seed = 0;
    for (const View& view : views) {
      const SurfaceHit reference = test::point_reference(view.p);
      for (const PointSampler sampler :
           {PointSampler::spherical, PointSampler::area, PointSampler::parallel}) {
        test::Draws draws(++seed);
        std::vector<double> observed(kBins * kBins), expected(kBins * kBins);
        const auto draw = [&] { return static_cast<float>(draws.uniform() * (1 - 0x1p-24)); };
        int drawn = 0;
        for (int i = 0; i < kDraws; ++i) {
          DirectSample light;
          const float u = draw(), v = draw();
          if (lights.sample(reference, view.front, 0, {u, v}, light, LightTechnique::adapted, sampler) ==
              DirectOutcome::failed)
            continue;
          const double b = (0.1 - static_cast<double>(light.p.y)) / 0.4,
                       a = (static_cast<double>(light.p.x) - 0.1 - shear * b) / 0.5;
          const auto cell = [](double x) {
            return std::min(static_cast<std::size_t>(std::max(0.0, (x + 1) / 2) * kBins), kBins - 1);
          };
          observed[cell(b) * kBins + cell(a)] += 1;
          ++drawn;
        }
        ASSERT_GT(drawn, kDraws * 0.999);
        for (std::size_t i = 0; i < kBins * kFine; ++i)
          for (std::size_t j = 0; j < kBins * kFine; ++j) {
            const double b = (2.0 * static_cast<double>(i) + 1) / (kBins * kFine) - 1,
                         a = (2.0 * static_cast<double>(j) + 1) / (kBins * kFine) - 1;
            SurfaceHit hit;
            hit.p = Vec3(Vec3d(0.1 + 0.5 * a + shear * b, 0.1 - 0.4 * b, 2));
            hit.ng = {0, 0, -1};
            hit.emitter = 0;
            const Vec3d d = Vec3d(hit.p) - Vec3d(view.p);
            const double r = length(d), area = 0.8 / (kBins * kFine * kBins * kFine);
            expected[i / kFine * kBins + j / kFine] += kDraws * area * d.z / (r * r * r) *
                                                       static_cast<double>(lights.pdf_point_solid_angle(
                                                           reference, view.front, Vec3(d / r), hit, sampler));
          }
        double total = 0;
        for (const double e : expected) total += e / kDraws;
        EXPECT_NEAR(total, 1, 3e-3) << "sampler " << static_cast<int>(sampler) << " from " << view.p.z;
        for (double& e : expected) e /= total;
        EXPECT_GT(test::chi_squared_p(observed, expected), 1e-6)
            << "sampler " << static_cast<int>(sampler) << " from " << view.p.z << " shear " << shear;
      }
    }
  }
}

// Claim: near, far, grazing, behind and in the plane, a draw fails or lies on the lamp with a finite density,
// which is the one stated for its point.
TEST(PointSamplers, SurviveExtremePlaces) {
  const char* const lamps[] = {
      R"(<shape type="rectangle">)", R"(<shape type="cube">)",
      R"(<shape type="rectangle"><transform name="to_world"><matrix value="1 0.5 0 0 0 0.7 0 0 0 0 1 0 0 0 0 1"/></transform>)",
      R"(<shape type="rectangle"><transform name="to_world"><scale x="1000" y="0.001"/></transform>)",
      R"(<shape type="rectangle"><transform name="to_world"><scale x="1e-4" y="1e-4"/></transform>)"};
  for (const char* lamp : lamps) {
    auto scene = test::build_scene(std::string(lamp) + R"(<emitter type="area"/></shape>)");
    ASSERT_TRUE(scene.ok()) << scene.error().to_string();
    const Lights& lights = (*scene)->lights();
    test::Draws draws(5);
    for (const float height : {-1.0f, 0.0f, 1e-30f, 1e-7f, 1e-4f, 0.01f, 1.0f, 1.5f, 1e3f, 1e6f, 1e12f}) {
      for (const float aside : {0.0f, 0.5f, 1.0f, 3.0f, 1e5f}) {
        const SurfaceHit reference = test::point_reference({aside, aside / 2, height});
        for (const Vec3 front : {Vec3{}, Vec3{0, 0, -1}, Vec3{0, 0, 1}, normalize(Vec3{1, 0.2f, -1e-3f}),
                                 normalize(Vec3{-1, 0.3f, -1})}) {
          for (const PointSampler sampler : kSamplers) {
            for (int i = 0; i < 40; ++i) {
              DirectSample light;
              const Vec2 u{static_cast<float>(draws.uniform()) * 0.999999f, i % 8 == 0 ? 0.0f : 0.37f};
              const auto outcome =
                  lights.sample(reference, front, 0.4f, u, light, LightTechnique::adapted, sampler);
              if (outcome == DirectOutcome::failed) continue;
              ASSERT_TRUE(light.pdf_solid_angle > 0 && std::isfinite(light.pdf_solid_angle));
              ASSERT_NEAR(length(light.wi), 1, 1e-5f);
              SurfaceHit hit;
              hit.p = light.p;
              hit.ng = light.ng;
              hit.emitter = light.emitter;
              hit.primitive = light.primitive;
              for (const PointSampler other : kSamplers) {
                const float pdf = lights.pdf_point_solid_angle(reference, front, light.wi, hit, other);
                ASSERT_TRUE(pdf >= 0 && std::isfinite(pdf)) << lamp << height << " " << aside;
                if (other == sampler && height >= 1e-4f && height < 1e5f && pdf > 0) {
                  ASSERT_NEAR(pdf / light.pdf_solid_angle, 1, 2e-3f)
                      << lamp << height << " " << aside << " sampler " << static_cast<int>(sampler);
                }
              }
            }
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace candela::scene
