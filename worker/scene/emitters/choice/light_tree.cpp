#include "worker/scene/emitters/choice/light_tree.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "common/base/work_monitor.h"
#include "worker/core/math.h"
#include "worker/scene/emitters/cone.h"

namespace candela::scene {
namespace {

// Emitters spread over a sphere of radius r around the reference are as if at less than r; below half of it
// one near emitter is too likely to be the one that counts.
constexpr float kNearest = 0.25f;  // least squared distance, in squared radii
constexpr float kBound = 0.5f;     // share of the bound in a cosine, the rest is that at the center
constexpr int kBins = 12;
constexpr int kBalancedFrom = 26;  // depth from which nodes are halved, so that trails fit 64 bits

// A cone of directions; spread below 0: empty.
struct Cone {
  Vec3 axis{0, 0, 1};
  float spread = -1, emission = 0;
  float cosine = 1, sine = 0;  // of the spread

  void set_spread(float angle) {
    spread = std::min(angle, math::kPi);
    math::sincosf(spread, sine, cosine);
  }
};

Cone cone_of(const LightBounds& light) {
  Cone cone;
  cone.axis = light.axis;
  cone.emission = light.emission;
  cone.set_spread(light.spread);
  return cone;
}

// The smallest cone around two [Conty 2018, Alg. 1].
Cone unite(const Cone& one, const Cone& other) {
  if (one.spread < 0) return other;
  if (other.spread < 0) return one;
  const Cone& wide = one.spread >= other.spread ? one : other;
  const Cone& thin = one.spread >= other.spread ? other : one;
  Cone result = wide;
  result.emission = std::max(one.emission, other.emission);
  const float cosine = dot(wide.axis, thin.axis);
  // Within the wide one already: angle <= wide - thin.
  if (wide.spread >= math::kPi || cosine >= wide.cosine * thin.cosine + wide.sine * thin.sine) return result;
  const Vec3 across = cross(wide.axis, thin.axis);
  const float sine_between = length(across), between = math::atan2f(sine_between, cosine);
  const float spread = (wide.spread + between + thin.spread) / 2;
  if (spread >= math::kPi || sine_between < 1e-4f) {
    // All directions, unless the axes are the same but for rounding.
    result.set_spread(cosine > 0 ? std::max(wide.spread, between + thin.spread) : math::kPi);
    return result;
  }
  float s = 0, c = 0;
  math::sincosf(spread - wide.spread, s, c);
  // Towards the thin one by that angle; axes are unit, so this is a rotation in their plane.
  const Vec3 side = (thin.axis - wide.axis * cosine) / sine_between;
  result.axis = normalize(wide.axis * c + side * s);
  result.set_spread(spread + 1e-5f);
  return result;
}

// The solid angle a cone's emission fills, weighted by its cosine [Conty 2018, Eq. 1].
double orientation_measure(const Cone& cone) {
  constexpr double kPi = static_cast<double>(math::kPi);
  const double o = static_cast<double>(std::max(0.0f, cone.spread));
  const double w = std::min(o + static_cast<double>(cone.emission), kPi);
  const double co = static_cast<double>(cone.cosine), so = static_cast<double>(cone.sine);
  const double tail = 2 * (w - o) * so - static_cast<double>(math::cosf(static_cast<float>(o - 2 * w))) + co;
  return 2 * kPi * (1 - co) + kPi / 2 * tail;
}

// The surface of the sphere around a box: nodes know the sphere, and the box of a row of points has none.
double surface(const Bounds& box) {
  const double r = box.radius();
  return r * r;
}

struct Sum {
  Bounds box;
  Cone cone;
  double power = 0;
  std::uint32_t count = 0;
  void add(const LightBounds& light) {
    box.add(light.box.low);
    box.add(light.box.high);
    cone = unite(cone, cone_of(light));
    power += light.power;
    ++count;
  }
  void add(const Sum& other) {
    if (other.count == 0) return;
    box.add(other.box.low);
    box.add(other.box.high);
    cone = unite(cone, other.cone);
    power += other.power;
    count += other.count;
  }
};

}  // namespace

struct LightTree::Build {
  LightTree& tree;
  std::vector<LightBounds>& lights;

  // The node over [begin, end), and all below it.
  Sum node(std::size_t begin, std::size_t end, int depth, std::uint64_t trail) {
    const std::size_t index = tree.nodes_.size();
    tree.nodes_.emplace_back();
    Sum sum;
    float strength = 0;
    if (end - begin == 1) {
      const LightBounds& light = lights[begin];
      sum.add(light);
      strength = light.strength;
      tree.nodes_[index].link = kLeaf | light.emitter;
      tree.trails_[light.emitter] = trail;
      tree.depths_[light.emitter] = static_cast<std::uint8_t>(depth);
    } else {
      const std::size_t middle = split(begin, end, depth);
      sum.add(node(begin, middle, depth + 1, trail));
      const auto second = static_cast<std::uint32_t>(tree.nodes_.size());
      sum.add(node(middle, end, depth + 1, trail | std::uint64_t{1} << depth));
      tree.nodes_[index].link = second;
      strength = tree.nodes_[index + 1].strength + tree.nodes_[second].strength;
    }
    Node& node = tree.nodes_[index];
    node.center = Vec3(sum.box.center());
    const double rounding = 1e-6 * (std::abs(sum.box.center().x) + std::abs(sum.box.center().y) +
                                    std::abs(sum.box.center().z) + sum.box.radius());
    node.radius = end - begin == 1 && sum.box.radius() == 0
                      ? 0.0f
                      : static_cast<float>(sum.box.radius() * (1 + 1e-6) + rounding);
    node.axis = sum.cone.axis;
    node.cos_spread = sum.cone.cosine;
    node.sin_spread = sum.cone.sine;
    node.cos_emission = math::cosf(std::min(sum.cone.emission, math::kPi));
    node.strength = std::min(strength, kMaxImportance);
    return sum;
  }

  std::size_t halve(std::size_t begin, std::size_t end, int axis) {
    const std::size_t middle = (begin + end) / 2;
    const auto at = [&](std::size_t i) { return lights.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(at(begin), at(middle), at(end), [&](const LightBounds& a, const LightBounds& b) {
      const double x = center(a, axis), y = center(b, axis);
      return x != y ? x < y : a.emitter < b.emitter;  // a total order: the outcome is one
    });
    return middle;
  }

  static double center(const LightBounds& light, int axis) {
    return axis == 0   ? light.box.low.x + light.box.high.x
           : axis == 1 ? light.box.low.y + light.box.high.y
                       : light.box.low.z + light.box.high.z;
  }

  std::size_t split(std::size_t begin, std::size_t end, int depth) {
    work_step();
    std::array<double, 3> low, high;
    low.fill(std::numeric_limits<double>::infinity());
    high.fill(-std::numeric_limits<double>::infinity());
    for (std::size_t i = begin; i < end; ++i) {
      for (int axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<std::size_t>(axis);
        low[a] = std::min(low[a], center(lights[i], axis));
        high[a] = std::max(high[a], center(lights[i], axis));
      }
    }
    int widest = 0;
    for (int axis = 1; axis < 3; ++axis) {
      const auto a = static_cast<std::size_t>(axis), w = static_cast<std::size_t>(widest);
      if (high[a] - low[a] > high[w] - low[w]) widest = axis;
    }
    const double longest = high[static_cast<std::size_t>(widest)] - low[static_cast<std::size_t>(widest)];
    if (end - begin == 2 || depth >= kBalancedFrom || !(longest > 0) || !std::isfinite(longest))
      return halve(begin, end, widest);

    double best = std::numeric_limits<double>::infinity();
    int best_axis = -1, best_bin = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<std::size_t>(axis);
      const double extent = high[a] - low[a];
      if (!(extent > 1e-3 * longest)) continue;
      std::array<Sum, kBins> bins;
      for (std::size_t i = begin; i < end; ++i)
        bins[static_cast<std::size_t>(bin_of(lights[i], axis, low[a], extent))].add(lights[i]);
      std::array<Sum, kBins> above;  // of the bins from i on
      Sum sum;
      for (int i = kBins - 1; i > 0; --i) {
        sum.add(bins[static_cast<std::size_t>(i)]);
        above[static_cast<std::size_t>(i)] = sum;
      }
      Sum below;
      for (int i = 1; i < kBins; ++i) {
        below.add(bins[static_cast<std::size_t>(i - 1)]);
        const Sum& rest = above[static_cast<std::size_t>(i)];
        if (below.count == 0 || rest.count == 0) continue;
        // [Conty 2018, Eq. 2], with the longest side over this one's against thin boxes.
        const double cost = (longest / extent) * (weight(below) + weight(rest));
        if (cost < best) {
          best = cost;
          best_axis = axis;
          best_bin = i;
        }
      }
    }
    if (best_axis < 0) return halve(begin, end, widest);
    const auto a = static_cast<std::size_t>(best_axis);
    const double extent = high[a] - low[a];
    const auto middle = std::stable_partition(
        lights.begin() + static_cast<std::ptrdiff_t>(begin),
        lights.begin() + static_cast<std::ptrdiff_t>(end),
        [&](const LightBounds& light) { return bin_of(light, best_axis, low[a], extent) < best_bin; });
    return static_cast<std::size_t>(middle - lights.begin());
  }

  static int bin_of(const LightBounds& light, int axis, double low, double extent) {
    return std::clamp(static_cast<int>((center(light, axis) - low) / extent * kBins), 0, kBins - 1);
  }

  static double weight(const Sum& sum) {
    return sum.power * orientation_measure(sum.cone) * surface(sum.box);
  }
};

LightTree::LightTree(std::vector<LightBounds> lights, std::size_t emitter_count) {
  if (lights.empty()) return;
  nodes_.reserve(2 * lights.size() - 1);
  trails_.assign(emitter_count, 0);
  depths_.assign(emitter_count, kOutside);
  Build{*this, lights}.node(0, lights.size(), 0, 0);
}

// The bounds decide what is zero. How much the rest counts is an estimate: distance and cosines of a node
// that is wide as seen from the reference lie between those of its center and the bounds.
float LightTree::importance(const Node& node, Vec3 p, Vec3 front) {
  const bool both_sides = is_zero(front);
  const Vec3 v = node.center - p;
  const float d2 = length_squared(v);
  const float h = dot(front, v);
  if (!both_sides && h <= -node.radius * (1 + kCosineSlack) - kCosineSlack * std::sqrt(d2)) return 0;
  const float inverse_d = 1 / std::sqrt(std::max(d2, 1e-36f));
  const float sin_extent = std::min(1.0f, node.radius * inverse_d), cos_extent = sine(sin_extent);
  const float least = std::max(node.radius * node.radius * kNearest, 1e-36f);
  float result = node.strength / std::max(d2, least);
  // The least angle between a normal and the direction from the emitter to the reference.
  float c = std::clamp(-dot(node.axis, v) * inverse_d, -1.0f, 1.0f), s = sine(c);
  subtract_angle(c, s, node.cos_spread, node.sin_spread);
  const float at_center = std::max(c, 0.0f);
  subtract_angle(c, s, cos_extent, sin_extent);
  if (d2 > node.radius * node.radius && c < node.cos_emission - kCosineSlack) return 0;
  result *= std::max(kBound * c + (1 - kBound) * at_center, kMinBoundCosine);
  if (!both_sides) {
    c = std::clamp(h * inverse_d, -1.0f, 1.0f);
    s = sine(c);
    const float seen_at_center = std::max(c, 0.0f);
    subtract_angle(c, s, cos_extent, sin_extent);
    result *= std::max(kBound * c + (1 - kBound) * seen_at_center, kMinBoundCosine);
  }
  return std::min(result, kMaxImportance);
}

template <bool kWeighted>
bool LightTree::descend(Vec3 p, Vec3 front, double u, std::span<const float> weights, std::uint32_t& emitter,
                        float& prob, double& rest) const {
  if (empty() || !(importance(nodes_[0], p, front) > 0)) return false;
  std::size_t at = 0;
  [[maybe_unused]] std::size_t upper = 0;  // of upper_, while `at` is not below the cut
  double q = 1;
  while ((nodes_[at].link & kLeaf) == 0) {
    const std::size_t second = nodes_[at].link;
    auto one = static_cast<double>(importance(nodes_[at + 1], p, front));
    auto other = static_cast<double>(importance(nodes_[second], p, front));
    [[maybe_unused]] std::size_t second_upper = 0;
    if constexpr (kWeighted) {
      second_upper = upper_[upper].second;
      if (second_upper != 0) {
        one *= static_cast<double>(weights[upper + 1]);
        other *= static_cast<double>(weights[second_upper]);
      }
    }
    const double sum = one + other;
    if (!(sum > 0)) return false;
    const double share = one / sum;
    if (u < share) {
      u = u / share;
      q *= share;
      at = at + 1;
      if constexpr (kWeighted) upper += second_upper != 0 ? 1 : 0;
    } else {
      const double left = other / sum;
      u = (u - share) / left;
      q *= left;
      at = second;
      if constexpr (kWeighted) upper = second_upper != 0 ? second_upper : upper;
    }
    u = std::clamp(u, 0.0, 1.0 - 0x1p-53);
  }
  emitter = nodes_[at].link & ~kLeaf;
  prob = static_cast<float>(q);
  rest = u;
  return prob > 0;
}

template <bool kWeighted>
float LightTree::prob_of(Vec3 p, Vec3 front, std::uint32_t emitter, std::span<const float> weights) const {
  if (emitter >= depths_.size() || depths_[emitter] == kOutside) return 0;
  if (!(importance(nodes_[0], p, front) > 0)) return 0;
  std::size_t at = 0;
  [[maybe_unused]] std::size_t upper = 0;
  double q = 1;
  std::uint64_t trail = trails_[emitter];
  for (int depth = depths_[emitter]; depth > 0; --depth, trail >>= 1) {
    const std::size_t second = nodes_[at].link;
    auto one = static_cast<double>(importance(nodes_[at + 1], p, front));
    auto other = static_cast<double>(importance(nodes_[second], p, front));
    const bool take_second = (trail & 1) != 0;
    if constexpr (kWeighted) {
      if (const std::size_t second_upper = upper_[upper].second; second_upper != 0) {
        one *= static_cast<double>(weights[upper + 1]);
        other *= static_cast<double>(weights[second_upper]);
        upper = take_second ? second_upper : upper + 1;
      }
    }
    const double sum = one + other;
    if (!(sum > 0)) return 0;
    q *= (take_second ? other : one) / sum;
    at = take_second ? second : at + 1;
  }
  return static_cast<float>(q);
}

bool LightTree::sample(Vec3 p, Vec3 front, double u, std::uint32_t& emitter, float& prob,
                       double& rest) const {
  return descend<false>(p, front, u, {}, emitter, prob, rest);
}
float LightTree::prob(Vec3 p, Vec3 front, std::uint32_t emitter) const {
  return prob_of<false>(p, front, emitter, {});
}
bool LightTree::sample(Vec3 p, Vec3 front, double u, std::span<const float> weights, std::uint32_t& emitter,
                       float& prob, double& rest) const {
  return descend<true>(p, front, u, weights, emitter, prob, rest);
}
float LightTree::prob(Vec3 p, Vec3 front, std::uint32_t emitter, std::span<const float> weights) const {
  return prob_of<true>(p, front, emitter, weights);
}

void LightTree::cut(std::size_t max_groups) {
  if (empty()) return;
  std::vector<std::uint32_t> groups = {0};
  std::vector<bool> above(nodes_.size(), false);
  const auto inner = [&](std::uint32_t node) { return (nodes_[node].link & kLeaf) == 0; };
  const auto extent = [&](std::uint32_t node) {
    return inner(node) ? nodes_[node].strength * nodes_[node].radius * nodes_[node].radius : -1.0f;
  };
  while (groups.size() < max_groups) {
    const auto widest =
        std::max_element(groups.begin(), groups.end(), [&](auto a, auto b) { return extent(a) < extent(b); });
    const std::uint32_t node = *widest;
    if (!inner(node)) break;
    above[node] = true;
    *widest = node + 1;
    groups.push_back(nodes_[node].link);
  }
  // A node above the cut waits for its second child.
  std::vector<std::uint32_t> waiting;
  for (std::uint32_t node = 0;;) {
    const auto index = static_cast<std::uint32_t>(upper_.size());
    upper_.push_back({node});
    if (above[node]) {
      waiting.push_back(index);
      ++node;
      continue;
    }
    upper_[index].group = static_cast<std::uint32_t>(groups_++);
    if (waiting.empty()) break;
    upper_[waiting.back()].second = index + 1;
    node = nodes_[upper_[waiting.back()].node].link;
    waiting.pop_back();
  }
}

std::uint32_t LightTree::group(std::uint32_t emitter) const {
  std::size_t upper = 0;
  for (std::uint64_t trail = trails_[emitter]; upper_[upper].second != 0; trail >>= 1)
    upper = (trail & 1) != 0 ? upper_[upper].second : upper + 1;
  return upper_[upper].group;
}

std::span<const float> LightTree::node_weights(std::span<const std::uint8_t> of_groups,
                                               std::span<float> out) const {
  for (std::size_t i = upper_.size(); i-- > 0;) {
    const Upper& upper = upper_[i];
    if (upper.second == 0) {
      out[i] = static_cast<float>(of_groups[upper.group]);
      continue;
    }
    const float one = nodes_[upper_[i + 1].node].strength, other = nodes_[upper_[upper.second].node].strength;
    const float sum = one + other, share = sum > 0 && std::isfinite(sum) ? one / sum : 0.5f;
    out[i] = share * out[i + 1] + (1 - share) * out[upper.second];
  }
  return out.first(upper_.size());
}

std::uint64_t LightTree::bytes() const {
  return nodes_.capacity() * sizeof(Node) + trails_.capacity() * sizeof(std::uint64_t) + depths_.capacity();
}

}  // namespace candela::scene
