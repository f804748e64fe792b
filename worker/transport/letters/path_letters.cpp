#include "worker/transport/letters/path_letters.h"

#include <utility>

#include "worker/scene/objects.h"
#include "worker/transport/letters/vertex_letter.h"

namespace candela::transport {

using letters::Letter;
using letters::Side;

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
  for (std::size_t label = 0; label < automaton_.label_count(); ++label) {
    std::uint64_t& bits = layer_bits_.emplace_back(0);
    for (const std::uint8_t layer : automaton_.layers(static_cast<letters::Automaton::Label>(label)))
      bits |= std::uint64_t{1} << layer;
  }
}

ChannelStates PathLetters::at_outside(Vec3 d, std::uint64_t key) const {
  const scene::Lights& lights = scene_.lights();
  if (!several_outside_) return at_lamp(lights.environments()[0]);
  ChannelStates result;
  const auto emitters = emitters_outside(lights, d, key);
  for (std::size_t c = 0; c < kColors; ++c) result.of[c] = lamp_state_[emitters[c]];
  return result;
}

std::uint32_t PathLetters::regions_at(Vec3 p) const {
  if (regions_.empty()) return 0;
  const Vec3d at = Vec3d(p) + scene_.offset();
  std::uint32_t mask = 0;
  for (std::size_t i = 0; i < regions_.size(); ++i)
    if (is_inside(regions_[i], at)) mask |= 1u << i;
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
  const std::uint32_t object = scene_.objects().of_shape[hit.shape],
                      regions = regions_.empty() ? 0 : regions_at(hit.p);
  const auto diffuse = automaton_.class_of(Letter::diffuse, side, object, regions);
  if (closure.even()) return of_all(diffuse);  // it has no lobe but diffuse and delta ones
  const auto glossy = automaton_.class_of(Letter::glossy, side, object, regions);
  if (diffuse == glossy) return of_all(diffuse);
  const ChannelLetters drawn = letters_of_lobes(hit, closure, wo, wi, mode, glossy_below_, key);
  const auto chosen = [&](std::size_t c) { return drawn.of[c] == Letter::diffuse ? diffuse : glossy; };
  return {{chosen(0), chosen(1), chosen(2)}};
}

}  // namespace candela::transport
