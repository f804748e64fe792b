// Light path expressions on the paths of a scene: which token of common/letters/automaton.h a vertex is, and
// where its states lead. A walk from the eye carries states of the reverse automaton, a light path those of
// the forward one; where the two meet, a look-up gives the labels of the whole path.
//
// States are three, one for each color channel: a vertex may scatter by a diffuse and a glossy lobe at once,
// and which of them a path's letter names is drawn for each channel apart, with the lobe's share of the value
// in that channel, by a number of its own. So the layers add up to the image, and each has its expectation
// (one letter for all channels would not: docs/decisions/085).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/letters/automaton.h"
#include "common/letters/request.h"
#include "worker/scene/emitters/lights.h"
#include "worker/scene/scene.h"
#include "worker/transport/vertex.h"

namespace candela::transport {

inline constexpr std::size_t kColors = 3;

struct ChannelStates {
  std::array<letters::Automaton::State, kColors> of{};
};
struct ChannelClasses {
  std::array<letters::Automaton::Class, kColors> of{};
};
struct ChannelLabels {
  std::array<letters::Automaton::Label, kColors> of{};
  bool operator==(const ChannelLabels&) const = default;
};

class PathLetters {
 public:
  // first_layer: of the film, for the first expression of `request`; the others follow. The scene outlives
  // it.
  PathLetters(letters::Automaton automaton, const letters::LayerRequest& request, const scene::Scene& scene,
              std::uint32_t first_layer);

  // At the lens, and at a lamp.
  ChannelStates at_eye() const { return in_all(automaton_.reverse_start()); }
  ChannelStates at_lamp(std::uint32_t emitter) const { return in_all(lamp_state_[emitter]); }
  // At what sends the light from outside that is seen looking along d: of several environments, whose light
  // arrives together, one is drawn for each channel by its share.
  ChannelStates at_outside(Vec3 d, std::uint64_t key) const;
  // At the emitter; d: as above, if it is an environment.
  ChannelStates at_light(std::uint32_t emitter, Vec3 d, std::uint64_t key) const {
    return several_outside_ && scene_.lights().is_environment(emitter) ? at_outside(d, key)
                                                                       : at_lamp(emitter);
  }

  // The token of a surface that scatters between wo and wi (unit, world, away from it): by lobes that are not
  // delta (mode: as the closure is evaluated along wo; key: of the draw between lobes), or by a delta lobe.
  ChannelClasses by_lobes(const SurfaceHit& hit, const scene::Closure& closure, Vec3 wo, Vec3 wi,
                          TransportMode mode, std::uint64_t key) const;
  ChannelClasses by_delta(const SurfaceHit& hit, Vec3 wo, Vec3 wi) const;
  // Token of a vertex in a medium.
  ChannelClasses in_medium(std::uint32_t medium, Vec3 p) const;
  // Token of a vertex that scatters by lobes that are not delta.
  ChannelClasses of(const ScatterPoint& v, Vec3 wi, TransportMode mode, std::uint64_t key) const;
  // Token of a vertex that a walk left along wi.
  ChannelClasses left(const ScatterPoint& v, Vec3 wi, TransportMode mode, std::uint64_t key) const {
    return v.left_by_delta ? by_delta(v.hit, v.wo, wi) : of(v, wi, mode, key);
  }

  // One token more, seen from the light and from the eye.
  ChannelStates from_light(const ChannelStates& states, const ChannelClasses& token) const {
    ChannelStates next;
    for (std::size_t c = 0; c < kColors; ++c) next.of[c] = automaton_.forward(states.of[c], token.of[c]);
    return next;
  }
  ChannelStates from_eye(const ChannelStates& states, const ChannelClasses& token) const {
    ChannelStates next;
    for (std::size_t c = 0; c < kColors; ++c) next.of[c] = automaton_.reverse(states.of[c], token.of[c]);
    return next;
  }
  // Labels of the path that joins the two parts.
  ChannelLabels labels(const ChannelStates& light, const ChannelStates& eye) const {
    ChannelLabels result;
    for (std::size_t c = 0; c < kColors; ++c) result.of[c] = automaton_.label(light.of[c], eye.of[c]);
    return result;
  }

  // Bit i: a path of this label is in layer first_layer() + i of the film. Label 0 is in none.
  std::uint64_t layer_bits(letters::Automaton::Label label) const { return layer_bits_[label]; }
  std::size_t label_count() const { return layer_bits_.size(); }
  std::uint32_t first_layer() const { return first_layer_; }
  std::uint32_t layer_count() const { return layer_count_; }

 private:
  static ChannelStates in_all(letters::Automaton::State state) { return {{state, state, state}}; }
  static ChannelClasses of_all(letters::Automaton::Class c) { return {{c, c, c}}; }
  std::uint32_t regions_at(Vec3 p) const;

  const letters::Automaton automaton_;
  const scene::Scene& scene_;
  const std::vector<letters::Region> regions_;
  const float glossy_below_;
  const std::uint32_t first_layer_, layer_count_;
  const bool several_outside_;
  std::vector<letters::Automaton::State> lamp_state_;  // by emitter
  std::vector<std::uint64_t> layer_bits_;              // by label
};

}  // namespace candela::transport
