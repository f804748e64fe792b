#include "worker/mcmc/path_labels.h"

#include <bit>

namespace candela::mcmc {
namespace {

constexpr std::uint64_t kLabels = 0x6c6162656c73;  // "labels"

std::uint64_t with_place(std::uint64_t key, Vec3 p) {
  for (const float x : {p.x, p.y, p.z}) key = rng::combine(key, std::bit_cast<std::uint32_t>(x));
  return key;
}

}  // namespace

transport::ChannelLabels labels_of(const transport::PathLetters& letters, const scene::Scene& scene,
                                   const transport::path::FullPath& path) {
  std::uint64_t key = rng::key(kLabels);
  for (const transport::path::InnerVertex& v : path.inner) key = with_place(key, v.hit.p);
  const Vec3 outside = -path.along[0];
  transport::ChannelStates states = path.light.emitter == scene::kNone
                                        ? letters.at_outside(outside, with_place(key, outside))
                                        : letters.at_lamp(path.light.emitter);
  for (std::size_t i = 0; i < path.inner.size(); ++i) {
    const transport::path::InnerVertex& v = path.inner[i];
    const Vec3 to_light = -path.along[i], to_eye = path.along[i + 1];
    if (v.kind == transport::VertexKind::medium) {
      states = letters.from_light(states, letters.in_medium(v.medium, v.hit.p));
    } else if (v.delta) {
      states = letters.from_light(states, letters.by_delta(v.hit, to_eye, to_light));
    } else {
      scene::ClosureArena arena;
      const scene::Closure closure = scene.closure(v.hit, v.hit.shading.to_local(to_eye), arena);
      states =
          letters.from_light(states, letters.by_lobes(v.hit, closure, to_eye, to_light,
                                                      scene::TransportMode::radiance, rng::combine(key, i)));
    }
  }
  return letters.labels(states, letters.at_eye());
}

}  // namespace candela::mcmc
