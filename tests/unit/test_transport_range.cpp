// Kernels, radii of iterations, and the range search: against quadrature, literal products and brute force.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>

#include "common/rng/stream.h"
#include "tests/paths.h"
#include "worker/transport/kernels.h"
#include "worker/transport/radius.h"
#include "worker/transport/range_search.h"

namespace candela::transport {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr Kernel kKernels[] = {Kernel::constant, Kernel::epanechnikov, Kernel::perlin};
constexpr const char* kKernelNames[] = {"constant", "epanechnikov", "perlin"};  // of the truth table

// The truth table of the kernel theory: "case,method,N,quantity" -> value. Empty where it is not installed.
std::map<std::string, double> truth_table() {
  std::ifstream file(test::shared_path() / "theory" / "adaptive-kernels.csv");
  std::map<std::string, double> table;
  std::string line;
  while (std::getline(file, line)) {
    const std::size_t error = line.rfind(',');
    const std::size_t value = error == std::string::npos ? error : line.rfind(',', error - 1);
    if (value == std::string::npos) continue;
    table[line.substr(0, value)] = std::strtod(line.c_str() + value + 1, nullptr);
  }
  return table;
}

// Claim: kernels integrate to one over disc and ball, and effective areas and volumes are 1 / int K^2, at any
// radius. Midpoint rule in t, 20000 cells.
TEST(Kernels, AreNormalisedAndTheirEffectiveSizesAreThoseOfQuadrature) {
  const auto table = truth_table();
  for (const Kernel kernel : kKernels) {
    const std::string name(kKernelNames[static_cast<int>(kernel)]);
    for (const float radius : {1e-3f, 0.37f, 1.0f, 250.0f}) {
      const DiscKernel disc(kernel, radius);
      const BallKernel ball(kernel, radius);
      const double r = radius;
      double mass[2] = {0, 0}, square[2] = {0, 0};
      constexpr int kCells = 20000;
      for (int i = 0; i < kCells; ++i) {
        const double d = r * (i + 0.5) / kCells;
        const double ring = 2 * kPi * d * r / kCells;
        const double shell = 4 * kPi * d * d * r / kCells;
        const double a = static_cast<double>(disc.value(static_cast<float>(d * d)));
        const double b = static_cast<double>(ball.value(static_cast<float>(d * d)));
        mass[0] += a * ring, square[0] += a * a * ring;
        mass[1] += b * shell, square[1] += b * b * shell;
      }
      EXPECT_NEAR(mass[0], 1, 1e-6) << name << radius;
      EXPECT_NEAR(mass[1], 1, 1e-6) << name << radius;
      EXPECT_NEAR(square[0] * effective_area(kernel, r), 1, 1e-6) << name << radius;
      EXPECT_NEAR(square[1] * effective_volume(kernel, r), 1, 1e-6) << name << radius;
    }
    if (!table.empty()) {
      EXPECT_NEAR(effective_area(kernel, 1) * table.at("kernels/" + name + " d=2,quadrature,0,k3"), 1, 3e-8);
      EXPECT_NEAR(effective_volume(kernel, 1) * table.at("kernels/" + name + " d=3,quadrature,0,k3"), 1,
                  3e-8);
    }
  }
  EXPECT_DOUBLE_EQ(effective_area(Kernel::constant, 0.5), kPi * 0.25);
  EXPECT_DOUBLE_EQ(effective_volume(Kernel::constant, 0.5), 4 * kPi / 3 * 0.125);
}

// Claim: the Perlin profile is 1 - 10 t^3 + 15 t^4 - 6 t^5 [Perlin 2002], and nothing is negative.
TEST(Kernels, PerlinIsItsPolynomial) {
  const DiscKernel disc(Kernel::perlin, 1);
  const double top = static_cast<double>(disc.value(0));
  EXPECT_NEAR(top, 7 / (2 * kPi), 1e-6);
  for (double t = 0; t <= 1; t += 1.0 / 512) {
    const double expected = 1 + t * t * t * (-10 + t * (15 - 6 * t));
    EXPECT_NEAR(static_cast<double>(disc.value(static_cast<float>(t * t))) / top, expected, 2e-7) << t;
  }
  for (const Kernel kernel : kKernels) {
    for (const float d2 : {0.999999f, 1.0f, 1.0000001f}) EXPECT_GE(DiscKernel(kernel, 1).value(d2), 0);
  }
  EXPECT_EQ(DiscKernel(Kernel::constant, 1).value(1.0f), static_cast<float>(1 / kPi));
}

// Claim: shrinkage() is the literal product [Knaus 2011] to 1e-12, from both sides of the place where it
// changes to a series.
TEST(Radius, IsTheLiteralProduct) {
  for (const double alpha : {0.1, 0.5, 4.0 / 7, 2.0 / 3, 0.75, 0.9, 1.0}) {
    long double product = 1;
    double worst = 0;
    for (std::uint64_t i = 0; i <= 200000; ++i) {
      if (i > 0) product *= (static_cast<long double>(i) + alpha) / (static_cast<long double>(i) + 1);
      if (i < 3000 || i % 997 == 0)
        worst = std::max(worst, std::abs(static_cast<double>(shrinkage(i, alpha) / product - 1)));
    }
    EXPECT_LT(worst, alpha == 1 ? 1e-300 : 1e-12) << alpha;
  }
  EXPECT_EQ(shrinkage(0, 0.6), 1);
  EXPECT_DOUBLE_EQ(disc_radius(2, 1, 0.5), 2 * std::sqrt(0.75));
}

// Claim: up to iteration 2^40 it is Gamma(i + 1 + alpha) / (Gamma(1 + alpha) Gamma(i + 2)). The oracle steps
// in factors of two: the duplication formula Gamma(2 z) = 2^(2 z - 1) Gamma(z) Gamma(z + 1/2) / sqrt(pi)
// would need half integers, so Stirling's series in long double it is, good to 1e-17 here.
TEST(Radius, HoldsForHugeIterations) {
  for (const double alpha : {0.5, 2.0 / 3, 0.75, 0.9}) {
    for (int bits = 18; bits <= 40; ++bits) {
      const auto n = static_cast<std::uint64_t>(1) << bits;
      const long double a = alpha;
      const long double z = static_cast<long double>(n) + 1;
      // log Gamma(z + a) - log Gamma(z + 1) with the large terms combined by log1p.
      const auto stirling = [](long double v) { return 1 / (12 * v) - 1 / (360 * v * v * v); };
      const long double ratio = (z + a - 0.5L) * std::log1p((a - 1) / (z + 1)) + (a - 1) * std::log(z + 1) -
                                (a - 1) + stirling(z + a) - stirling(z + 1);
      const long double exact = std::exp(ratio) / std::tgamma(1 + a);
      EXPECT_NEAR(static_cast<double>(shrinkage(n, alpha) / exact), 1, 2e-12) << alpha << " 2^" << bits;
    }
  }
}

// Claim: the volume of balls shrinks as the area of discs does, never growing.
TEST(Radius, BallsShrinkInVolumeAsDiscsInArea) {
  double last = 1;
  for (std::uint64_t i = 0; i < 2000; ++i) {
    const double s = shrinkage(i, 2.0 / 3);
    EXPECT_LE(s, last);
    last = s;
    EXPECT_NEAR(std::pow(ball_radius(0.3, i, 2.0 / 3) / 0.3, 3) / s, 1, 1e-12);
    EXPECT_NEAR(std::pow(disc_radius(0.3, i, 2.0 / 3) / 0.3, 2) / s, 1, 1e-12);
    EXPECT_NEAR(ball_radius(1, i, 0.75), std::pow(disc_radius(1, i, 0.75), 2.0 / 3), 1e-12);
  }
}

// Claim: means over these radii give the exact variance and bias of the theory's toy: 25 photons of lognormal
// weight (sigma 1) per unit area, first radius 1/2, constant kernel, irradiance 1 (variance) or 1 + 2 |y|^2
// (whose bias is the mean of r_i^2).
TEST(Radius, GivesTheVarianceAndBiasOfTheTruthTable) {
  const auto table = truth_table();
  if (table.empty()) GTEST_SKIP() << "no ../shared/theory/adaptive-kernels.csv";
  const std::map<std::string, double> alphas = {
      {"0.500", 0.5}, {"0.667", 2.0 / 3}, {"0.750", 0.75}, {"0.900", 0.9}};
  for (const auto& [name, alpha] : alphas) {
    double variance = 0, bias = 0;
    std::uint64_t done = 0;
    for (const std::uint64_t n : {64, 1024, 8192, 1048576}) {
      for (; done < n; ++done) {
        const double r = disc_radius(0.5, done, alpha);
        variance += std::numbers::e / 25 / (kPi * r * r);
        bias += r * r;
      }
      const auto count = static_cast<double>(n);
      const std::string method = "density,PPM a=" + name + "," + std::to_string(n) + ",";
      EXPECT_NEAR(variance / count / count / table.at("ppm/const " + method + "MSE exact"), 1, 1e-7)
          << method;
      EXPECT_NEAR(bias / count / table.at("ppm/quad " + method + "bias exact"), 1, 1e-7) << method;
    }
  }
}

using Hits = std::vector<std::pair<std::uint32_t, float>>;

Hits brute_force(const std::vector<Vec3>& points, Vec3 p, float radius) {
  Hits hits;
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const Vec3 d = points[i] - p;
    const float d2 = d.x * d.x + d.y * d.y + d.z * d.z;
    if (std::isfinite(d2) && d2 <= radius * radius) hits.emplace_back(i, d2);
  }
  return hits;
}
Hits found(const RangeSearch& search, Vec3 p, float radius) {
  Hits hits;
  search.visit(p, radius, [&](std::uint32_t index, float d2) { hits.emplace_back(index, d2); });
  return hits;
}

struct Set {
  std::string name;
  std::vector<Vec3> points;
  float size;  // a typical distance
};

std::vector<Set> point_sets() {
  rng::Stream stream(rng::key(41));
  const auto u = [&] { return stream.next_float(); };
  const auto signed_u = [&] { return 2 * stream.next_float() - 1; };
  constexpr int kCount = 1500;
  std::vector<Set> sets;
  const auto add = [&](const char* name, float size, int count, const auto& make) {
    Set set{name, {}, size};
    for (int i = 0; i < count; ++i) set.points.push_back(make(i));
    sets.push_back(std::move(set));
  };
  add("none", 1, 0, [](int) { return Vec3{}; });
  add("one", 1, 1, [](int) { return Vec3{3, 4, 5}; });
  add("seven", 1, 7, [&](int) { return Vec3{u(), u(), u()}; });
  add("volume", 1, kCount, [&](int) { return Vec3{u(), u(), u()}; });
  add("plane x", 1, kCount, [&](int) { return Vec3{0.25f, u(), u()}; });
  add("plane y", 1, kCount, [&](int) { return Vec3{u(), -7, u()}; });
  add("plane z", 1, kCount, [&](int) { return Vec3{u(), u(), 1e-9f}; });
  add("slanted plane", 1, kCount, [&](int) {
    const float a = u(), b = u();
    return Vec3{a, b, 0.3f * a - 0.7f * b};
  });
  add("sphere", 1, kCount, [&](int) { return normalize(Vec3{signed_u(), signed_u(), signed_u()}); });
  add("line x", 1, kCount, [&](int) { return Vec3{u(), 0, 0}; });
  add("line z", 1, kCount, [&](int) { return Vec3{0, 0, u()}; });
  add("at one place", 1, kCount, [](int) { return Vec3{0.1f, -0.2f, 0.3f}; });
  add("two places", 1, kCount, [](int i) { return Vec3{i % 3 == 0 ? 1.0f : 0.0f, 0, 0}; });
  add("lattice", 1, 1728, [](int i) {  // many distances that equal the radius
    return Vec3(static_cast<float>(i % 12), static_cast<float>(i / 12 % 12), static_cast<float>(i / 144)) *
           0.125f;
  });
  add("clusters", 1, kCount, [&](int i) {
    const auto c = static_cast<float>(i % 9);
    return Vec3{c + 1e-4f * signed_u(), 2 * c + 1e-4f * signed_u(), 1e-4f * signed_u()};
  });
  add("1e-6 to 1e6", 1, kCount, [&](int i) {
    const float scale = std::ldexp(1e-6f, i % 41);
    return Vec3{scale * signed_u(), scale * signed_u(), scale * signed_u()};
  });
  add("far away", 1, kCount, [&](int) { return Vec3{1e6f + u(), -3e6f + u(), 1e6f + 20 * u()}; });
  add("huge", 1e18f, kCount, [&](int) { return Vec3{1e18f * u(), 1e18f * u(), 1e18f * u()}; });
  add("minute", 1e-21f, kCount, [&](int) { return Vec3{1e-21f * u(), 1e-21f * u(), 1e-21f * u()}; });
  add("one far off", 1, kCount, [&](int i) {
    return i == 77 ? Vec3{3e37f, -3e37f, 1} : Vec3{u(), u(), u()};
  });
  return sets;
}

// Claim: each point within the radius is visited once and no other, for any distribution, whatever the radius
// that the structure was built for and whatever the query's.
TEST(RangeSearch, FindsWhatBruteForceFinds) {
  std::uint64_t total = 0;
  for (const Set& set : point_sets()) {
    rng::Stream stream(rng::key(42));
    for (const float build : {0.0f, 1e-12f, 1e-4f, 0.01f, 0.125f, 0.5f, 30.0f, 1e30f}) {
      RangeSearch search;
      search.build(std::span<const Vec3>(set.points), build * set.size, 1);
      ASSERT_EQ(search.size(), set.points.size());
      for (int q = 0; q < 24; ++q) {
        Vec3 p{stream.next_float() * 3 - 1, stream.next_float() * 3 - 1, stream.next_float() * 3 - 1};
        p = p * set.size;
        const std::size_t count = set.points.size();
        if (count > 0 && q % 4 != 0) {
          p = set.points[stream.next_u32() % count];
          if (q % 4 == 1) p.x += 0.1f * set.size * stream.next_float();
        }
        for (const float r : {0.0f, 1e-7f, 0.003f, 0.05f, 0.125f, 0.25f, 1.7f, 100.0f, 1e19f}) {
          const float radius = q % 5 == 4 ? build * r : r * set.size;
          Hits got = found(search, p, radius);
          std::sort(got.begin(), got.end());
          const Hits expected = brute_force(set.points, p, radius);
          ASSERT_EQ(got, expected) << set.name << " built for " << build << " radius " << radius;
          total += expected.size();
        }
      }
    }
  }
  EXPECT_GT(total, 1000000u);
}

// Points on a sphere and in clusters, enough for many partitions and chunks; some equal.
std::vector<Vec3> many_points(std::size_t count) {
  rng::Stream stream(rng::key(43));
  std::vector<Vec3> points(count);
  for (std::size_t i = 0; i < count; ++i) {
    Vec3 p{2 * stream.next_float() - 1, 2 * stream.next_float() - 1, 2 * stream.next_float() - 1};
    points[i] = i % 3 == 0 ? p : normalize(p);
    if (i % 50 == 49) points[i] = points[i - 40];
  }
  return points;
}

// Claim: order of slots and of visits are the same for any number of threads; order() is a permutation; equal
// points are in index order; visit() and visit_slots() tell of the same points, in ascending slots.
TEST(RangeSearch, DoesNotDependOnThreads) {
  const std::vector<Vec3> points = many_points(300001);
  const tbb::global_control five_threads(tbb::global_control::max_allowed_parallelism, 5);
  RangeSearch one, two, five;
  one.build(std::span<const Vec3>(points), 0.02f, 1);
  two.build(std::span<const Vec3>(points), 0.02f, 2);
  five.build(std::span<const Vec3>(points), 0.02f, 5);
  ASSERT_TRUE(std::ranges::equal(one.order(), two.order()));
  ASSERT_TRUE(std::ranges::equal(one.order(), five.order()));
  std::vector<bool> seen(points.size());
  for (std::uint32_t slot = 0; slot < one.size(); ++slot) {
    ASSERT_FALSE(seen[one.order()[slot]]);
    seen[one.order()[slot]] = true;
    ASSERT_EQ(one.position(slot), points[one.order()[slot]]);
  }
  std::uint64_t hits = 0;
  for (std::size_t i = 0; i < 2000; ++i) {
    const Vec3 p = points[i * 149];
    const float radius = 0.005f * static_cast<float>(i % 10 + 1);  // up to 2.5 times that of the build
    const Hits first = found(one, p, radius);
    ASSERT_EQ(first, found(two, p, radius));
    ASSERT_EQ(first, found(five, p, radius));
    Hits slots;
    one.visit_slots(p, radius, [&](std::uint32_t slot, float d2) { slots.emplace_back(slot, d2); });
    ASSERT_TRUE(std::ranges::is_sorted(slots));
    for (std::size_t k = 0; k < slots.size(); ++k)
      ASSERT_EQ(std::pair(one.order()[slots[k].first], slots[k].second), first[k]);
    std::uint32_t last = 0;
    for (const auto& [index, d2] : first) {
      if (points[index] != p) continue;
      ASSERT_GE(index, last);
      last = index;
    }
    hits += first.size();
  }
  EXPECT_GT(hits, 50000u);
}

// Claim: many points are found as by brute force too (partitions, chunks, wrapped rows).
TEST(RangeSearch, FindsAllOfMany) {
  const std::vector<Vec3> points = many_points(200000);
  for (const float build : {0.0005f, 0.02f, 0.4f}) {
    RangeSearch search;
    search.build(std::span<const Vec3>(points), build, 2);
    for (std::size_t i = 0; i < 60; ++i) {
      const Vec3 p = points[i * 3001] + Vec3{0, 1e-3f, -1e-3f};
      const float radius = build * (0.3f + 0.1f * static_cast<float>(i));
      Hits got = found(search, p, radius);
      std::sort(got.begin(), got.end());
      ASSERT_EQ(got, brute_force(points, p, radius)) << build << " " << radius;
    }
  }
}

// Claim: it can be built again and again, from the inside of records, and its order forgotten; its size is as
// documented: 12 bytes of position, 4 of order, and the table of buckets.
TEST(RangeSearch, TakesRecordsAndIsBuiltAgain) {
  struct Record {
    std::uint32_t tag;
    Vec3 position;
    float rest[12];
  };
  std::vector<Record> records;
  for (const Vec3& p : many_points(70000))
    records.push_back({static_cast<std::uint32_t>(records.size()), p, {}});
  RangeSearch search;
  for (const std::size_t count : {std::size_t{70000}, std::size_t{0}, std::size_t{5}, std::size_t{70000}}) {
    const auto part = std::span<const Record>(records).first(count);
    search.build(PositionView(part, &Record::position), 0.05f, 2);
    const auto sorted = permuted(part, search.order());
    ASSERT_EQ(sorted.size(), count);
    const Hits by_index = found(search, {0.6f, 0.6f, 0.6f}, 0.3f);
    if (count > 5) {
      EXPECT_LE(search.bytes(), count * (12 + 4 + 4) + 200);
    }
    search.forget_order();
    EXPECT_TRUE(search.order().empty());
    Hits by_slot;
    search.visit_slots({0.6f, 0.6f, 0.6f}, 0.3f, [&](std::uint32_t slot, float d2) {
      EXPECT_EQ(sorted[slot].position, search.position(slot));
      by_slot.emplace_back(sorted[slot].tag, d2);
    });
    EXPECT_EQ(by_slot, by_index);
    if (count > 5) {
      EXPECT_GT(by_slot.size(), 100u);
    }
  }
  EXPECT_LE(search.bytes(), 70000u * (12 + 4) + 200);  // without its order
}

}  // namespace
}  // namespace candela::transport
