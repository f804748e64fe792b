#include "worker/transport/letters/path_letters.h"

#include <utility>

#include "common/rng/stream.h"
#include "worker/scene/objects.h"

namespace candela::transport {
namespace {

using letters::Letter;
using letters::Side;

bool inside(const letters::Region& region, Vec3d p) {
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

Side side_of(const SurfaceHit& hit, Vec3 wo, Vec3 wi) {
  return dot(wo, hit.ng) * dot(wi, hit.ng) < 0 ? Side::transmitted : Side::reflected;
}

}  // namespace

PathLetters::PathLetters(letters::Automaton automaton, const letters::LayerRequest& request,
                         const scene::Scene& scene, std::uint32_t first_layer)
    : automaton_(std::move(automaton)),
      scene_(scene),
      regions_(request.regions),
      glossy_below_(static_cast<float>(request.glossy_below)),
      first_layer_(first_layer),
      layer_count_(static_cast<std::uint32_t>(request.layers.size())),
      several_outside_(scene.lights().environments().size() > 1) {
  for (const std::uint32_t object : scene.objects().of_emitter)
    lamp_state_.push_back(automaton_.forward(automaton_.forward_start(),
                                             automaton_.class_of(Letter::lamp, Side::none, object, 0)));
}

ChannelStates PathLetters::at_outside(Vec3 d, std::uint64_t key) const {
  const scene::Lights& lights = scene_.lights();
  const auto& environments = lights.environments();
  if (!several_outside_) return at_lamp(environments[0]);
  const Spectrum all_light = lights.environment(d);
  const auto u = static_cast<float>(rng::to_double(rng::combine(key, 0x736b79ULL)));  // "sky"
  ChannelStates result = at_lamp(environments.back());
  Spectrum before;
  // From the last to the first, so that the first whose sum is beyond u stays.
  std::vector<Spectrum> sums;
  for (const std::uint32_t i : environments) sums.push_back(before += lights.environment(i, d));
  for (std::size_t e = environments.size(); e-- > 0;) {
    const auto state = lamp_state_[environments[e]];
    if (u * all_light.r < sums[e].r) result.of[0] = state;
    if (u * all_light.g < sums[e].g) result.of[1] = state;
    if (u * all_light.b < sums[e].b) result.of[2] = state;
  }
  return result;
}

std::uint32_t PathLetters::regions_at(Vec3 p) const {
  if (regions_.empty()) return 0;
  const Vec3d at = Vec3d(p) + scene_.offset();
  std::uint32_t mask = 0;
  for (std::size_t i = 0; i < regions_.size(); ++i)
    if (inside(regions_[i], at)) mask |= 1u << i;
  return mask;
}

ChannelClasses PathLetters::by_delta(const SurfaceHit& hit, Vec3 wo, Vec3 wi) const {
  return of_all(automaton_.class_of(Letter::specular, side_of(hit, wo, wi),
                                    scene_.objects().of_shape[hit.shape], regions_at(hit.p)));
}

ChannelClasses PathLetters::in_medium(std::uint32_t medium, Vec3 p) const {
  return of_all(
      automaton_.class_of(Letter::volume, Side::none, scene_.objects().of_medium[medium], regions_at(p)));
}

ChannelClasses PathLetters::of(const ScatterPoint& v, Vec3 wi, TransportMode mode, std::uint64_t key) const {
  return v.on_surface() ? by_lobes(v.hit, v.closure, v.wo, wi, mode, key) : in_medium(v.medium, v.hit.p);
}

ChannelClasses PathLetters::by_lobes(const SurfaceHit& hit, const scene::Closure& closure, Vec3 wo, Vec3 wi,
                                     TransportMode mode, std::uint64_t key) const {
  const Side side = side_of(hit, wo, wi);
  const std::uint32_t object = scene_.objects().of_shape[hit.shape], regions = regions_at(hit.p);
  const auto diffuse = automaton_.class_of(Letter::diffuse, side, object, regions);
  const auto glossy = automaton_.class_of(Letter::glossy, side, object, regions);
  // An even closure has no lobe but diffuse and delta ones.
  if (diffuse == glossy || closure.even()) return of_all(diffuse);
  const Vec3 local_wo = hit.shading.to_local(wo), local_wi = hit.shading.to_local(wi);
  const Spectrum value = closure.eval(local_wo, local_wi, mode);
  const Spectrum part = closure.eval_diffuse(local_wo, local_wi, mode, glossy_below_);
  // One number for the three channels: they differ where the lobes' shares do.
  const auto u = static_cast<float>(rng::to_double(rng::combine(key, 0x6c6f6265ULL)));  // "lobe"
  const auto choose = [&](float all_lobes, float diffuse_lobes) {
    return u * all_lobes < diffuse_lobes ? diffuse : glossy;
  };
  return {{choose(value.r, part.r), choose(value.g, part.g), choose(value.b, part.b)}};
}

}  // namespace candela::transport
