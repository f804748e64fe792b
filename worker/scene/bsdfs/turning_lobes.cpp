#include "worker/scene/turning_lobes.h"

#include <algorithm>

#include "worker/scene/bsdfs/delta_lobes.h"
#include "worker/scene/bsdfs/kinds.h"

namespace candela::scene {
namespace {

// sample() divides [0, 1) of u_lobe among at most two lobes.
bool divides_in_two(const Closure& closure) {
  return closure.is<DielectricClosure>() || closure.is<ConductorClosure>() ||
         closure.is<ThinDielectricClosure>() || closure.is<PlasticClosure>();
}

TurningLobes lobes_at_ends(const Closure& closure, Vec3 wo, Vec2 u, TransportMode mode) {
  TurningLobes list;
  BsdfSample lobe;
  // The two ends of the range are in different lobes, if there are two.
  constexpr float kEnds[] = {0, 0x1.fffffep-1f};
  bool any = false, transmitted = false;
  for (const float end : kEnds) {
    if (!closure.sample(wo, end, u, mode, lobe) || !lobe.delta) continue;
    if (any && lobe.transmitted == transmitted) continue;  // the same lobe
    any = true;
    transmitted = lobe.transmitted;
    if (!lobe.passthrough) list.lobes[list.count++] = {lobe.wi, lobe.weight * lobe.prob};
  }
  return list;
}

// Directions that differ by less are one: parts of a composite compute one reflection in several ways.
constexpr float kSameDirection = 1e-6f;

// The lobes of a composite, one for each direction.
std::vector<TurningLobe> lobes_by_direction(const Closure& closure, Vec3 wo, TransportMode mode) {
  std::vector<TurningLobe> list;
  for (const DeltaLobe& lobe : delta_lobes(closure, wo, mode)) {
    if (lobe.passthrough || lobe.value.is_black()) continue;
    const auto same = std::find_if(list.begin(), list.end(), [&](const TurningLobe& other) {
      const Vec3 apart = other.wi - lobe.wi;
      return dot(apart, apart) < kSameDirection * kSameDirection;
    });
    if (same == list.end())
      list.push_back({lobe.wi, lobe.value});
    else
      same->attenuation += lobe.value;
  }
  return list;
}

// The brightest lobe, and one of the others in proportion to its brightness, over its probability.
TurningLobes two_of(std::vector<TurningLobe> list, float u_lobe) {
  const auto brightness = [](const TurningLobe& lobe) {
    return static_cast<double>(lobe.attenuation.max_component());
  };
  std::ranges::stable_sort(list, [&](const auto& a, const auto& b) { return brightness(a) > brightness(b); });
  double rest = 0;
  for (std::size_t i = 1; i < list.size(); ++i) rest += brightness(list[i]);
  double left = static_cast<double>(u_lobe) * rest;
  std::size_t drawn = 1;
  while (drawn + 1 < list.size() && left >= brightness(list[drawn])) left -= brightness(list[drawn++]);
  TurningLobe other = list[drawn];
  other.attenuation *= static_cast<float>(rest / brightness(other));
  return {{list[0], other}, 2};
}

}  // namespace

TurningLobes turning_lobes(const Closure& closure, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode) {
  if (closure.black || !closure.has_delta_lobes()) return {};
  if (divides_in_two(closure)) return lobes_at_ends(closure, wo, u, mode);
  if (closure.is<PathEditedClosure>()) {  // it has no list
    TurningLobes list;
    BsdfSample lobe;
    if (closure.sample(wo, u_lobe, u, mode, lobe) && lobe.delta && !lobe.passthrough)
      list.lobes[list.count++] = {lobe.wi, lobe.weight};
    return list;
  }
  const std::vector<TurningLobe> all = lobes_by_direction(closure, wo, mode);
  if (all.size() > TurningLobes::kMax) return two_of(all, u_lobe);
  TurningLobes list;
  for (const TurningLobe& lobe : all) list.lobes[list.count++] = lobe;
  return list;
}

}  // namespace candela::scene
