#include "worker/transport/letters/vertex_letter.h"

#include <vector>

#include "common/rng/stream.h"
#include "worker/transport/scattering.h"

namespace candela::transport {

using letters::Letter;

ChannelLetters letters_of_lobes(const SurfaceHit& hit, const scene::Closure& closure, Vec3 wo, Vec3 wi,
                                TransportMode mode, float glossy_below, std::uint64_t key) {
  // An even closure has no lobe but diffuse and delta ones.
  if (closure.even()) return {{Letter::diffuse, Letter::diffuse, Letter::diffuse}};
  const auto [value, part] = SurfaceScattering(hit, closure, wo).parts(wi, mode, glossy_below);
  // One number for the three channels: they differ where the lobes' shares do.
  const auto u = static_cast<float>(rng::to_double(rng::combine(key, 0x6c6f6265ULL)));  // "lobe"
  const auto choose = [&](float all_lobes, float diffuse_lobes) {
    return u * all_lobes < diffuse_lobes ? Letter::diffuse : Letter::glossy;
  };
  return {{choose(value.r, part.r), choose(value.g, part.g), choose(value.b, part.b)}};
}

std::array<std::uint32_t, kColors> emitters_outside(const scene::Lights& lights, Vec3 d, std::uint64_t key) {
  const auto& environments = lights.environments();
  std::array<std::uint32_t, kColors> result;
  result.fill(environments.back());
  if (environments.size() == 1) return result;
  const Spectrum all_light = lights.environment(d);
  const auto u = static_cast<float>(rng::to_double(rng::combine(key, 0x736b79ULL)));  // "sky"
  Spectrum before;
  // From the last to the first, so that the first whose sum is beyond u stays.
  std::vector<Spectrum> sums;
  for (const std::uint32_t i : environments) sums.push_back(before += lights.environment(i, d));
  for (std::size_t e = environments.size(); e-- > 0;) {
    if (u * all_light.r < sums[e].r) result[0] = environments[e];
    if (u * all_light.g < sums[e].g) result[1] = environments[e];
    if (u * all_light.b < sums[e].b) result[2] = environments[e];
  }
  return result;
}

bool is_inside(const letters::Region& region, Vec3d p) {
  const std::array<double, 3> at = {p.x, p.y, p.z};
  if (region.kind == letters::Region::Kind::box) {
    for (std::size_t i = 0; i < 3; ++i)
      if (at[i] < region.low[i] || at[i] > region.high[i]) return false;
    return true;
  }
  double squared = 0;
  for (std::size_t i = 0; i < 3; ++i) squared += (at[i] - region.low[i]) * (at[i] - region.low[i]);
  return squared <= region.radius * region.radius;
}

}  // namespace candela::transport
