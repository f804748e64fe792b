#include "worker/scene/turning_lobes.h"

#include "worker/scene/bsdfs/kinds.h"

namespace candela::scene {
namespace {

// sample() divides [0, 1) of u_lobe among at most two lobes.
bool divides_in_two(const Closure& closure) {
  return closure.is<DielectricClosure>() || closure.is<ConductorClosure>() ||
         closure.is<ThinDielectricClosure>() || closure.is<PlasticClosure>();
}

}  // namespace

TurningLobes turning_lobes(const Closure& closure, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode) {
  TurningLobes list;
  if (closure.black || !closure.has_delta_lobes()) return list;
  BsdfSample lobe;
  if (!divides_in_two(closure)) {
    if (closure.sample(wo, u_lobe, u, mode, lobe) && lobe.delta && !lobe.straight)
      list.lobes[list.count++] = {lobe.wi, lobe.weight};
    return list;
  }
  // The two ends of the range are in different lobes, if there are two.
  constexpr float kEnds[] = {0, 0x1.fffffep-1f};
  bool any = false, transmitted = false;
  for (const float end : kEnds) {
    if (!closure.sample(wo, end, u, mode, lobe) || !lobe.delta) continue;
    if (any && lobe.transmitted == transmitted) continue;  // the same lobe
    any = true;
    transmitted = lobe.transmitted;
    if (!lobe.straight) list.lobes[list.count++] = {lobe.wi, lobe.weight * lobe.prob};
  }
  return list;
}

}  // namespace candela::scene
