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
  if (const auto& outside = scene.lights().environments(); !outside.empty()) outside_ = outside.front();
  if (!regions_.empty()) return;
  const auto shapes = static_cast<std::uint32_t>(scene.objects().of_shape.size());
  of_shape_.reserve(shapes);
  for (std::uint32_t shape = 0; shape < shapes; ++shape) of_shape_.push_back(classes_of(shape, 0));
}

ChannelStates PathLetters::at_one_outside(Vec3 d, std::uint64_t key) const {
  ChannelStates result;
  const auto emitters = emitters_outside(scene_.lights(), d, key);
  for (std::size_t c = 0; c < kColors; ++c) result.put(c, lamp_state_[emitters[c]]);
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

PathLetters::SurfaceClasses PathLetters::classes_of(std::uint32_t shape, std::uint32_t regions) const {
  const std::uint32_t object = scene_.objects().of_shape[shape];
  const auto both = [&](Letter letter) {
    return std::array<Class, 2>{automaton_.class_of(letter, Side::reflected, object, regions),
                                automaton_.class_of(letter, Side::transmitted, object, regions)};
  };
  return {both(Letter::diffuse), both(Letter::glossy), both(Letter::specular)};
}

ChannelClasses PathLetters::in_medium(std::uint32_t medium, Vec3 p) const {
  return ChannelClasses(
      automaton_.class_of(Letter::volume, Side::none, scene_.objects().of_medium[medium], regions_at(p)));
}

ChannelClasses PathLetters::drawn(const SurfaceHit& hit, const scene::Closure& closure, Vec3 wo, Vec3 wi,
                                  TransportMode mode, std::uint64_t key, Class diffuse, Class glossy) const {
  const ChannelLetters letters = letters_of_lobes(hit, closure, wo, wi, mode, glossy_below_, key);
  ChannelClasses result;
  for (std::size_t c = 0; c < kColors; ++c)
    result.put(c, letters.of[c] == Letter::diffuse ? diffuse : glossy);
  return result;
}

}  // namespace candela::transport
