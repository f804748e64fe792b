// A hierarchy over many emitters, descended at random from a reference point: a choice among n of them in
// proportion to an estimate of what each gives there, in O(log n) [Conty 2018].
//
// A node knows a sphere around its emitters, a cone around their normals with the widest angle of emission
// from one, and the sum of their strengths. Its importance is an upper estimate of the irradiance it can
// give; it is zero only where it can give none. At each node one child is chosen by the two importances. The
// build (binned, by the surface area orientation heuristic) is serial and depends on the emitters alone.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "worker/core/vec.h"
#include "worker/scene/emitters/light_bounds.h"

namespace candela::scene {

class LightTree {
 public:
  LightTree() = default;
  explicit LightTree(std::vector<LightBounds> lights, std::size_t emitter_count);

  bool empty() const { return nodes_.empty(); }
  // An estimate of the irradiance from all of it. front: as in Scene::sample_direct.
  float importance(Vec3 p, Vec3 front) const { return empty() ? 0.0f : importance(nodes_[0], p, front); }

  // One emitter; prob is the discrete probability of that. rest: what is left of u, uniform in [0, 1) again.
  // False: none of those that were left over can light the point.
  bool sample(Vec3 p, Vec3 front, double u, std::uint32_t& emitter, float& prob, double& rest) const;
  // The probability with which sample() chooses the emitter; 0 where it is not in the tree.
  float prob(Vec3 p, Vec3 front, std::uint32_t emitter) const;

  // Weights of groups of emitters: the nodes of a cut through the tree, numbered depth first. The cut splits
  // the node that is the widest and strongest until there are so many groups. To be called once.
  void cut(std::size_t max_groups);
  std::size_t groups() const { return groups_; }
  std::uint32_t group(std::uint32_t emitter) const;  // of one in the tree
  // The weights of the nodes down to the cut, the root's first: of a node above the cut the mean of its
  // children's by strength. out: at least 2 groups() - 1 entries; those are returned.
  std::span<const float> node_weights(std::span<const std::uint8_t> of_groups, std::span<float> out) const;
  // sample() and prob() with importances times such weights.
  bool sample(Vec3 p, Vec3 front, double u, std::span<const float> weights, std::uint32_t& emitter,
              float& prob, double& rest) const;
  float prob(Vec3 p, Vec3 front, std::uint32_t emitter, std::span<const float> weights) const;

  std::uint64_t bytes() const;

 private:
  template <bool kWeighted>
  bool descend(Vec3 p, Vec3 front, double u, std::span<const float> weights, std::uint32_t& emitter,
               float& prob, double& rest) const;
  template <bool kWeighted>
  float prob_of(Vec3 p, Vec3 front, std::uint32_t emitter, std::span<const float> weights) const;

  // Three quarters of a cache line.
  struct Node {
    Vec3 center;
    float radius = 0;
    Vec3 axis;
    float cos_spread = 1, sin_spread = 0;
    float cos_emission = 0;
    float strength = 0;
    std::uint32_t link = 0;  // the second child (the first is the next node), or kLeaf | emitter
  };
  static constexpr std::uint32_t kLeaf = 0x80000000u;
  struct Build;

  static float importance(const Node& node, Vec3 p, Vec3 front);

  std::vector<Node> nodes_;            // depth first
  std::vector<std::uint64_t> trails_;  // by emitter: bit d says which child to take at depth d
  std::vector<std::uint8_t> depths_;   // by emitter; kOutside where it is not in the tree
  static constexpr std::uint8_t kOutside = 255;
  // A node of the cut or above, depth first.
  struct Upper {
    std::uint32_t node;
    std::uint32_t second = 0;  // the second child (the first is the next); 0: a node of the cut
    std::uint32_t group = 0;   // of a node of the cut
  };
  std::vector<Upper> upper_;
  std::size_t groups_ = 0;
};

}  // namespace candela::scene
