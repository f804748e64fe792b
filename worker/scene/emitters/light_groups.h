// Groups of emitters whose light is sampled apart: a choice is among the emitters of one group, with the
// probabilities that the technique has among all, normalized. All environments are in one group, since their
// light arrives together.
#pragma once

#include <cstdint>
#include <vector>

#include "worker/scene/emitters/lights.h"
#include "worker/scene/features.h"

namespace candela::scene {

enum class LightPartition : std::uint8_t {
  one,       // all emitters are one group
  infinite,  // emitters with a place; emitters that are infinitely far away
  each,      // each emitter, but all environments together
};

// The groups that a scene has by the partition; 0 without emitters.
inline std::uint32_t light_group_count(LightPartition partition, const SceneFeatures& features) {
  const std::uint32_t all = features.emitters, far = features.infinite_emitters,
                      environments = features.environments;
  if (partition == LightPartition::each) return all - (environments > 1 ? environments - 1 : 0);
  if (partition == LightPartition::infinite) return (far > 0 ? 1U : 0U) + (all > far ? 1U : 0U);
  return all > 0 ? 1 : 0;
}

// One group, for the choice among its members.
struct LightGroup {
  std::vector<std::uint8_t> members;  // weights by Lights::group(): 0 or 255
  Lights::NodeWeights node_weights{};
  PowerChooser by_power, uniform;
};

class LightGroups {
 public:
  // Precondition: at least 2 emitters, in more than one group; the lights outlive this.
  LightGroups(const Lights& lights, LightPartition partition);

  std::size_t size() const { return groups_.size(); }
  const LightGroup& operator[](std::size_t group) const { return groups_[group]; }
  std::size_t of(std::uint32_t emitter) const { return of_emitter_[emitter]; }
  // The group of the environment. Precondition: there is an environment.
  std::size_t of_environment() const { return of_environment_; }

 private:
  std::vector<std::uint32_t> of_emitter_;
  std::uint32_t of_environment_ = 0;
  std::vector<LightGroup> groups_;
};

}  // namespace candela::scene
