#include "worker/scene/emitters/light_groups.h"

#include <algorithm>

namespace candela::scene {

LightGroups::LightGroups(const Lights& lights, LightPartition partition) {
  const std::size_t emitters = lights.size();
  std::uint32_t count = 0, environments = kNone;
  for (std::uint32_t i = 0; i < emitters; ++i) {
    std::uint32_t group = 0;
    if (partition == LightPartition::infinite) {
      group = lights.infinite(i) ? 1 : 0;
    } else if (partition == LightPartition::each) {
      const bool together = lights.is_environment(i) && environments != kNone;
      group = together ? environments : count;
    }
    if (lights.is_environment(i)) environments = group;
    of_emitter_.push_back(group);
    count = std::max(count, group + 1);
  }
  of_environment_ = environments == kNone ? 0 : environments;
  groups_.resize(count);
  for (std::uint32_t g = 0; g < count; ++g) {
    LightGroup& group = groups_[g];
    std::vector<double> powers(emitters), ones(emitters);
    group.members.assign(Lights::kMaxGroups, 0);
    for (std::uint32_t i = 0; i < emitters; ++i) {
      if (of_emitter_[i] != g) continue;
      powers[i] = lights.weight_of_power(i);
      ones[i] = 1;
      group.members[lights.group(i)] = 255;
    }
    group.by_power = PowerChooser(powers);
    group.uniform = PowerChooser(ones);
    lights.weights(group.members, group.node_weights);
  }
}

}  // namespace candela::scene
