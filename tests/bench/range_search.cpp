// Queries per second of the range search against nanoflann's kd-tree on the same points, and the time to
// build either. usage: bench_range_search [points=1000000] [rounds=5] [threads=1]
//
// Points are uniform on the walls of a unit box and on two spheres inside it, as photons are in a Cornell
// box; their order is random, as that of paths is. Queries: "pixels" are what a pinhole camera before the
// open side sees, row by row; "scattered" are points of the surfaces in random order. Radii are such that a
// query finds 1, 5, 20, 100 points on the mean. A round takes both structures in turn; the ratio is the
// median over the rounds; CPU time of one thread, save that our build is in wall clock where `threads` is
// not 1.
//
// "records": each hit also reads a 64-byte record, by the index of the point (ours, kd-tree) or in the order
// of the slots (ours). "permut" is the time to bring the records into that order, one thread.
#include <time.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <nanoflann.hpp>
#include <numbers>
#include <vector>

#include "common/rng/stream.h"
#include "tests/bench/count_argument.h"
#include "worker/transport/range_search.h"

namespace {

using namespace candela;
using transport::PositionView;
using transport::RangeSearch;

double cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}
double wall_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

struct Sphere {
  Vec3 center;
  float radius;
};
constexpr Sphere kSpheres[] = {{{0.3f, 0.35f, 0.2f}, 0.2f}, {{0.7f, 0.6f, 0.25f}, 0.25f}};
double area() {
  double a = 5;
  for (const Sphere& s : kSpheres) a += 4 * std::numbers::pi * s.radius * s.radius;
  return a;
}

Vec3 on_surface(rng::Stream& stream) {
  double u = stream.next_double() * area();
  if (u < 5) {
    const float a = stream.next_float();
    const float b = stream.next_float();
    switch (static_cast<int>(u)) {
      case 0:
        return {0, a, b};
      case 1:
        return {1, a, b};
      case 2:
        return {a, 1, b};
      case 3:
        return {a, b, 0};
      default:
        return {a, b, 1};
    }
  }
  u -= 5;
  const double first = 4 * std::numbers::pi * kSpheres[0].radius * kSpheres[0].radius;
  const Sphere& s = kSpheres[u < first ? 0 : 1];
  const double z = 2 * stream.next_double() - 1;
  const double phi = 2 * std::numbers::pi * stream.next_double();
  const double r = std::sqrt(1 - z * z);
  return s.center + s.radius * Vec3(static_cast<float>(r * std::cos(phi)),
                                    static_cast<float>(r * std::sin(phi)), static_cast<float>(z));
}

// View of a camera at (1/2, -1.2, 1/2) through the open side y = 0.
std::vector<Vec3> pixels(std::size_t side) {
  std::vector<Vec3> result;
  const Vec3 eye{0.5f, -1.2f, 0.5f};
  for (std::size_t row = 0; row < side; ++row) {
    for (std::size_t column = 0; column < side; ++column) {
      const float u = (static_cast<float>(column) + 0.5f) / static_cast<float>(side);
      const float v = (static_cast<float>(row) + 0.5f) / static_cast<float>(side);
      const Vec3 d = normalize(Vec3{u, 0, v} - eye);
      float t = (1 - eye.y) / d.y;
      if (d.x > 0) t = std::min(t, (1 - eye.x) / d.x);
      if (d.x < 0) t = std::min(t, -eye.x / d.x);
      if (d.z > 0) t = std::min(t, (1 - eye.z) / d.z);
      if (d.z < 0) t = std::min(t, -eye.z / d.z);
      for (const Sphere& s : kSpheres) {
        const Vec3 o = eye - s.center;
        const float b = dot(o, d);
        const float q = b * b - dot(o, o) + s.radius * s.radius;
        if (q > 0) t = std::min(t, -b - std::sqrt(q));
      }
      result.push_back(eye + t * d);
    }
  }
  return result;
}

struct Cloud {
  const std::vector<Vec3>& points;
  std::size_t kdtree_get_point_count() const { return points.size(); }
  float kdtree_get_pt(std::size_t i, std::size_t axis) const {
    const Vec3& p = points[i];
    return axis == 0 ? p.x : axis == 1 ? p.y : p.z;
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using Tree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Cloud>, Cloud, 3, std::uint32_t>;

// Hands each hit on, as a renderer's gathering would take it.
template <class Visit>
struct Results {
  float r2;
  Visit& visit;
  std::size_t found = 0;
  std::size_t size() const { return found; }
  bool full() const { return true; }
  bool addPoint(float d2, std::uint32_t index) {
    if (d2 <= r2) {
      ++found;
      visit(index, d2);
    }
    return true;
  }
  float worstDist() const { return r2; }
};

struct alignas(64) Record {
  Vec3 position;
  float flux[13];
};

struct Totals {
  std::uint64_t hits = 0;
  double sum = 0;
};

double median(std::vector<double> v) {
  std::sort(v.begin(), v.end());
  return v[v.size() / 2];
}

void compare(const char* name, const std::vector<Vec3>& points, const std::vector<Vec3>& queries, double hits,
             int rounds, unsigned threads) {
  const auto radius =
      static_cast<float>(std::sqrt(hits * area() / (std::numbers::pi * static_cast<double>(points.size()))));
  HugeVector<Record> records(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) records[i] = {points[i], {static_cast<float>(i % 7)}};
  std::vector<double> ours, theirs, ratio, build, tree_build, in_order, in_slots, tree_records, permute;
  double bytes = 0;
  Totals a, b;
  for (int round = 0; round < rounds; ++round) {
    RangeSearch search;
    const auto clock = threads > 1 ? wall_seconds : cpu_seconds;
    double t = clock();
    search.build(PositionView(std::span<const Record>(records), &Record::position), radius, threads);
    build.push_back(clock() - t);
    bytes = static_cast<double>(search.bytes()) / static_cast<double>(points.size());
    t = cpu_seconds();
    const HugeVector<Record> sorted = transport::permuted(std::span<const Record>(records), search.order());
    permute.push_back(cpu_seconds() - t);
    t = cpu_seconds();
    const Cloud cloud{points};
    const Tree tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(10));
    tree_build.push_back(cpu_seconds() - t);

    const auto timed = [&](std::vector<double>& seconds, Totals& totals, const auto& query) {
      totals = {};
      const double start = cpu_seconds();
      for (const Vec3& q : queries) query(q, totals);
      seconds.push_back((cpu_seconds() - start) / static_cast<double>(queries.size()));
    };
    timed(ours, a, [&](Vec3 q, Totals& sums) {
      std::uint64_t found = 0;
      float sum = 0;
      search.visit(q, radius, [&](std::uint32_t index, float d2) {
        found += index < 0xffffffffu ? 1 : 0;
        sum += d2;
      });
      sums.hits += found;
      sums.sum += static_cast<double>(sum);
    });
    const auto tree_query = [&](Vec3 q, const auto& visit) {
      Results<decltype(visit)> results{radius * radius, visit};
      const float place[3] = {q.x, q.y, q.z};
      tree.findNeighbors(results, place, nanoflann::SearchParams(32, 0, false));
    };
    timed(theirs, b, [&](Vec3 q, Totals& sums) {
      std::uint64_t found = 0;
      float sum = 0;
      tree_query(q, [&](std::uint32_t index, float d2) {
        found += index < 0xffffffffu ? 1 : 0;
        sum += d2;
      });
      sums.hits += found;
      sums.sum += static_cast<double>(sum);
    });
    ratio.push_back(theirs.back() / ours.back());
    Totals c, d, e;
    timed(in_order, c, [&](Vec3 q, Totals& sums) {
      float sum = 0;
      search.visit(q, radius, [&](std::uint32_t index, float d2) { sum += d2 * records[index].flux[0]; });
      sums.sum += static_cast<double>(sum);
    });
    timed(in_slots, d, [&](Vec3 q, Totals& sums) {
      float sum = 0;
      search.visit_slots(q, radius, [&](std::uint32_t slot, float d2) { sum += d2 * sorted[slot].flux[0]; });
      sums.sum += static_cast<double>(sum);
    });
    timed(tree_records, e, [&](Vec3 q, Totals& sums) {
      float sum = 0;
      tree_query(q, [&](std::uint32_t index, float d2) { sum += d2 * records[index].flux[0]; });
      sums.sum += static_cast<double>(sum);
    });
    // The tree may round a distance otherwise, so a few on the border may differ.
    const auto most = static_cast<double>(std::max(a.hits, b.hits));
    if (std::abs(static_cast<double>(a.hits) - static_cast<double>(b.hits)) > 1e-5 * most + 2)
      std::printf("differ: %llu %llu\n", static_cast<unsigned long long>(a.hits),
                  static_cast<unsigned long long>(b.hits));
    if (std::abs(c.sum / d.sum - 1) > 1e-4) std::printf("records differ: %g %g %g\n", c.sum, d.sum, e.sum);
  }
  std::printf("%-9s %8zu %7.1f | %7.3f %7.3f %6.2f | %7.3f %7.3f %7.3f | %6.1f %6.1f %6.1f | %5.1f\n", name,
              points.size(), static_cast<double>(a.hits) / static_cast<double>(queries.size()),
              1e-6 / median(ours), 1e-6 / median(theirs), median(ratio), 1e-6 / median(in_order),
              1e-6 / median(in_slots), 1e-6 / median(tree_records), 1e3 * median(build),
              1e3 * median(tree_build), 1e3 * median(permute), bytes);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  const auto count = static_cast<std::size_t>(bench::count_argument("POINTS", argc, argv, 1, 1'000'000, 4e9));
  const auto rounds = static_cast<int>(bench::count_argument("ROUNDS", argc, argv, 2, 5, 1000));
  const auto threads = static_cast<unsigned>(bench::count_argument("THREADS", argc, argv, 3, 1, 1024));
  rng::Stream stream(rng::key(1, 2, 3));
  std::vector<Vec3> points(count), scattered(100000);
  for (Vec3& p : points) p = on_surface(stream);
  for (Vec3& p : scattered) p = on_surface(stream);
  const std::vector<Vec3> seen = pixels(300);
  std::printf(
      "                           | M queries/s            | with records            | build, ms            "
      "|\n"
      "queries     points    hits |    ours  kdtree  ratio | records   slots  kdtree |   ours kdtree permut "
      "| bytes\n");
  for (const double hits : {1.0, 5.0, 20.0, 100.0}) {
    compare("pixels", points, seen, hits, rounds, threads);
    compare("scattered", points, scattered, hits, rounds, threads);
  }
}
