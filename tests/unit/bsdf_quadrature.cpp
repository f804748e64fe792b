#include "bsdf_quadrature.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <queue>

namespace candela::test {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr std::size_t kNoBin = ~std::size_t{0};

// Gauss and Legendre's 5 points on [-1, 1].
constexpr std::array<double, 5> kNodes = {-0.906179845938664, -0.538469310105683, 0, 0.538469310105683,
                                          0.906179845938664};
constexpr std::array<double, 5> kWeights = {0.236926885056189, 0.478628670499366, 0.568888888888889,
                                            0.478628670499366, 0.236926885056189};

}  // namespace

SpherePoint to_point(Vec3 w) {
  const Vec3d d = normalize(Vec3d(w));
  // 1 - |cos| without cancellation.
  const double t2 = (d.x * d.x + d.y * d.y) / (1 + std::abs(d.z));
  return {d.z < 0, std::min(1.0, std::sqrt(t2)), std::atan2(d.y, d.x)};
}

Vec3 to_direction(const SpherePoint& p) {
  const double c = p.t * p.t;
  const double s = std::sqrt(c * (2 - c));
  return {static_cast<float>(s * std::cos(p.phi)), static_cast<float>(s * std::sin(p.phi)),
          static_cast<float>(p.below ? c - 1 : 1 - c)};
}

SphereBins::SphereBins(const std::vector<Vec3>& directions, int bins, int per_box)
    : per_bin_(std::max<std::size_t>(1, directions.size() / static_cast<std::size_t>(bins))),
      per_box_(static_cast<std::size_t>(per_box)) {
  std::array<std::vector<SpherePoint>, 2> sides;
  for (const Vec3 w : directions) {
    const SpherePoint p = to_point(w);
    sides[p.below ? 1 : 0].push_back(p);
  }
  for (std::size_t side = 0; side < 2; ++side)
    roots_[side] = build({side == 1, 0, 1, -kPi, kPi}, std::move(sides[side]), kNoBin, 0);
}

std::size_t SphereBins::build(const Box& box, std::vector<SpherePoint> points, std::size_t bin, int depth) {
  const std::size_t index = nodes_.size();
  nodes_.push_back({.box = box});
  // A node with points for less than two bins is one bin, with all that is split below it.
  if (bin == kNoBin && points.size() < 2 * per_bin_) bin = bin_count_++;
  const auto leaf = [&] {
    nodes_[index].bin = bin == kNoBin ? bin_count_++ : bin;
    nodes_[index].points = std::move(points);
    return index;
  };
  if (points.size() <= per_box_ || depth > 60) return leaf();

  const auto coordinate = [](const SpherePoint& p, int axis) { return axis == 0 ? p.t : p.phi; };
  int best_axis = -1;
  double best_split = 0;
  double best_packing = 1e9;
  for (int axis = 0; axis < 2; ++axis) {
    std::vector<double> values;
    values.reserve(points.size());
    for (const SpherePoint& p : points) values.push_back(coordinate(p, axis));
    std::sort(values.begin(), values.end());
    const double low = axis == 0 ? box.t0 : box.phi0;
    const double high = axis == 0 ? box.t1 : box.phi1;
    // Halve where the middle half of the points is packed most tightly in the box; first cut off what is
    // empty and far wider than what is not.
    const double packing = (values[values.size() * 3 / 4] - values[values.size() / 4]) / (high - low);
    double split = values[values.size() / 2];
    const double margin = 3 * (values.back() - values.front());
    const double before = values.front() - margin - low;
    const double after = high - values.back() - margin;
    if (std::max(before, after) > 0.5 * (high - low))
      split = before > after ? values.front() - margin : values.back() + margin;
    if (split > low && split < high && packing < best_packing) {
      best_axis = axis;
      best_split = split;
      best_packing = packing;
    }
  }
  if (best_axis < 0) return leaf();
  std::vector<SpherePoint> low;
  std::vector<SpherePoint> high;
  for (const SpherePoint& p : points) (coordinate(p, best_axis) < best_split ? low : high).push_back(p);
  Box low_box = box;
  Box high_box = box;
  (best_axis == 0 ? low_box.t1 : low_box.phi1) = best_split;
  (best_axis == 0 ? high_box.t0 : high_box.phi0) = best_split;
  const std::size_t low_index = build(low_box, std::move(low), bin, depth + 1);
  const std::size_t high_index = build(high_box, std::move(high), bin, depth + 1);
  nodes_[index].axis = best_axis;
  nodes_[index].split = best_split;
  nodes_[index].low = low_index;
  nodes_[index].high = high_index;
  return index;
}

std::size_t SphereBins::bin_of(Vec3 w) const {
  const SpherePoint p = to_point(w);
  const Node* node = &nodes_[roots_[p.below ? 1 : 0]];
  while (node->axis >= 0) {
    node = &nodes_[(node->axis == 0 ? p.t : p.phi) < node->split ? node->low : node->high];
  }
  return node->bin;
}

std::vector<Integrands> SphereBins::integrate(const std::function<Integrands(Vec3)>& f, double error,
                                              int most_boxes, double& error_left) const {
  struct Known {
    SpherePoint point;
    double density;
  };
  struct Piece {
    Box box;
    std::size_t bin = 0;
    std::array<Integrands, 4> quarters{};
    double density_error = 0, badness = 0;
    std::vector<Known> known = {};
    bool operator<(const Piece& other) const { return badness < other.badness; }
  };
  double largest = 0;  // density met by gauss() since it was set to 0
  const auto gauss = [&](const Box& b) {
    Integrands sum{};
    const double ht = 0.5 * (b.t1 - b.t0);
    const double hp = 0.5 * (b.phi1 - b.phi0);
    for (std::size_t i = 0; i < kNodes.size(); ++i) {
      const double t = b.t0 + ht * (1 + kNodes[i]);
      for (std::size_t j = 0; j < kNodes.size(); ++j) {
        const Integrands v = f(to_direction({b.below, t, b.phi0 + hp * (1 + kNodes[j])}));
        largest = std::max(largest, v[0]);
        const double weight = kWeights[i] * kWeights[j] * 2 * t * ht * hp;
        for (std::size_t k = 0; k < v.size(); ++k) sum[k] += weight * v[k];
      }
    }
    return sum;
  };
  // Four parts of a box: quarters, or slices across its length where it is long.
  const auto quarter = [](const Box& b, int k) {
    const double t = 0.5 * (b.t0 + b.t1);
    const double length_t = 2 * (b.t1 - b.t0);
    const double length_phi = t * std::sqrt(2 - t * t) * (b.phi1 - b.phi0);
    Box q = b;
    if (length_t > 2 * length_phi) {
      q.t0 = b.t0 + 0.25 * k * (b.t1 - b.t0);
      q.t1 = b.t0 + 0.25 * (k + 1) * (b.t1 - b.t0);
    } else if (length_phi > 2 * length_t) {
      q.phi0 = b.phi0 + 0.25 * k * (b.phi1 - b.phi0);
      q.phi1 = b.phi0 + 0.25 * (k + 1) * (b.phi1 - b.phi0);
    } else {
      ((k & 1) != 0 ? q.t0 : q.t1) = t;
      ((k & 2) != 0 ? q.phi0 : q.phi1) = 0.5 * (b.phi0 + b.phi1);
    }
    return q;
  };
  std::vector<Integrands> result(bin_count_);
  std::priority_queue<Piece> queue;
  double density_left = 0;
  double value_left = 0;
  // Adds the piece's quarters to its bin and queues it by what they differ by from it as a whole.
  const auto add = [&](Piece piece, const Integrands& whole) {
    Integrands sum{};
    largest = 0;
    for (int k = 0; k < 4; ++k) {
      auto& q = piece.quarters[static_cast<std::size_t>(k)];
      q = gauss(quarter(piece.box, k));
      for (std::size_t n = 0; n < q.size(); ++n) sum[n] += q[n];
    }
    for (std::size_t n = 0; n < sum.size(); ++n) result[piece.bin][n] += sum[n] - whole[n];
    piece.density_error = std::abs(sum[0] - whole[0]);
    double value_error = 0;
    for (std::size_t n = 1; n < sum.size(); ++n)
      value_error = std::max(value_error, std::abs(sum[n] - whole[n]));
    piece.badness = std::max(piece.density_error, value_error / 5);
    // A lobe known to be in the box that all nodes missed.
    double known = 0;
    for (const Known& k : piece.known) known = std::max(known, k.density);
    if (known > 3 * largest) {
      const Box& b = piece.box;
      piece.badness += 0.01 * known * (b.t1 * b.t1 - b.t0 * b.t0) * (b.phi1 - b.phi0);
    }
    density_left += piece.density_error;
    value_left += piece.badness;
    queue.push(std::move(piece));
  };
  for (const Node& node : nodes_) {
    if (node.axis >= 0) continue;
    const Integrands whole = gauss(node.box);
    for (std::size_t n = 0; n < whole.size(); ++n) result[node.bin][n] += whole[n];
    Piece piece{.box = node.box, .bin = node.bin};
    for (const SpherePoint& p : node.points) piece.known.push_back({p, f(to_direction(p))[0]});
    add(std::move(piece), whole);
  }
  int boxes = static_cast<int>(queue.size());
  while (!queue.empty() && value_left > error && boxes < most_boxes) {
    const Piece worst = queue.top();
    queue.pop();
    density_left -= worst.density_error;
    value_left -= worst.badness;
    for (int k = 0; k < 4; ++k) {
      Piece piece{.box = quarter(worst.box, k), .bin = worst.bin};
      const Box& b = piece.box;
      for (const Known& known : worst.known) {
        const SpherePoint& p = known.point;
        if (p.t >= b.t0 && p.t < b.t1 && p.phi >= b.phi0 && p.phi < b.phi1) piece.known.push_back(known);
      }
      add(std::move(piece), worst.quarters[static_cast<std::size_t>(k)]);
    }
    boxes += 4;
  }
  error_left = density_left;
  return result;
}

}  // namespace candela::test
