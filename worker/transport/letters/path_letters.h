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

// A number for each channel, in lanes of one word. They differ after a draw between lobes alone.
template <class Meaning>
class PerChannel {
 public:
  using Lane = std::uint16_t;
  PerChannel() = default;
  explicit PerChannel(Lane of_all) : lanes_(of_all * kOnes) {}
  Lane operator[](std::size_t c) const { return static_cast<Lane>(lanes_ >> (16 * c)); }
  // Precondition: the lane is 0.
  void put(std::size_t c, Lane value) { lanes_ |= std::uint64_t{value} << (16 * c); }
  bool uniform() const { return lanes_ == (lanes_ & 0xffff) * kOnes; }
  bool operator==(const PerChannel&) const = default;

 private:
  static constexpr std::uint64_t kOnes = 0x0001'0001'0001;
  std::uint64_t lanes_ = 0;
};
static_assert(sizeof(letters::Automaton::State) == 2 && sizeof(letters::Automaton::Class) == 2 &&
              sizeof(letters::Automaton::Label) == 2);

using ChannelStates = PerChannel<struct StatesMeaning>;
using ChannelClasses = PerChannel<struct ClassesMeaning>;
using ChannelLabels = PerChannel<struct LabelsMeaning>;

// The side on which a surface scatters. wo, wi: unit, world, away from it.
inline letters::Side side_of(const SurfaceHit& hit, Vec3 wo, Vec3 wi) {
  return dot(wo, hit.ng) * dot(wi, hit.ng) < 0 ? letters::Side::transmitted : letters::Side::reflected;
}

class PathLetters {
 public:
  // first_layer: of the film, for the first expression of `request`; the others follow. The scene outlives
  // it.
  PathLetters(letters::Automaton automaton, const letters::LayerRequest& request, const scene::Scene& scene,
              std::uint32_t first_layer);

  // At the lens, and at a lamp.
  ChannelStates at_eye() const { return ChannelStates(automaton_.reverse_start()); }
  ChannelStates at_lamp(std::uint32_t emitter) const { return ChannelStates(lamp_state_[emitter]); }
  // At what sends the light from outside that is seen looking along d: of several environments, whose light
  // arrives together, one is drawn for each channel by its share. Key, here and below: std::uint64_t, or what
  // becomes one if there is a draw.
  template <class Key>
  ChannelStates at_outside(Vec3 d, const Key& key) const {
    return several_outside_ ? at_one_outside(d, key) : at_lamp(outside_);
  }
  // At the emitter; d: as above, if it is an environment.
  template <class Key>
  ChannelStates at_light(std::uint32_t emitter, Vec3 d, const Key& key) const {
    if (several_outside_ && scene_.lights().is_environment(emitter)) [[unlikely]]
      return at_one_outside(d, key);
    return at_lamp(emitter);
  }

  // The token of a surface that scatters between wo and wi (unit, world, away from it): by lobes that are not
  // delta (mode: as the closure is evaluated along wo; key: of the draw between lobes), or by a delta lobe.
  template <class Key>
  ChannelClasses by_lobes(const SurfaceHit& hit, const scene::Closure& closure, Vec3 wo, Vec3 wi,
                          TransportMode mode, const Key& key) const {
    SurfaceClasses in_regions;
    const SurfaceClasses& classes = classes_at(hit, in_regions);
    const std::size_t side = side_of(hit, wo, wi) == letters::Side::transmitted ? 1 : 0;
    const Class diffuse = classes.diffuse[side], glossy = classes.glossy[side];
    // An even closure has no lobe but diffuse and delta ones.
    if (diffuse == glossy || closure.even()) return ChannelClasses(diffuse);
    return drawn(hit, closure, wo, wi, mode, key, diffuse, glossy);
  }
  ChannelClasses by_delta(const SurfaceHit& hit, Vec3 wo, Vec3 wi) const {
    SurfaceClasses in_regions;
    return ChannelClasses(
        classes_at(hit, in_regions).specular[side_of(hit, wo, wi) == letters::Side::transmitted ? 1 : 0]);
  }
  // Token of a vertex in a medium.
  ChannelClasses in_medium(std::uint32_t medium, Vec3 p) const;
  // Token of a vertex that scatters by lobes that are not delta.
  template <class Key>
  ChannelClasses of(const ScatterPoint& v, Vec3 wi, TransportMode mode, const Key& key) const {
    return v.on_surface() ? by_lobes(v.hit, v.closure, v.wo, wi, mode, key) : in_medium(v.medium, v.hit.p);
  }
  // Token of a vertex that a walk left along wi.
  template <class Key>
  ChannelClasses left(const ScatterPoint& v, Vec3 wi, TransportMode mode, const Key& key) const {
    return v.left_by_delta ? by_delta(v.hit, v.wo, wi) : of(v, wi, mode, key);
  }

  // One token more, seen from the light and from the eye.
  ChannelStates from_light(const ChannelStates& states, const ChannelClasses& token) const {
    return each<ChannelStates>(states, token, [&](State q, Class c) { return automaton_.forward(q, c); });
  }
  ChannelStates from_eye(const ChannelStates& states, const ChannelClasses& token) const {
    return each<ChannelStates>(states, token, [&](State r, Class c) { return automaton_.reverse(r, c); });
  }
  // Labels of the path that joins the two parts.
  ChannelLabels labels(const ChannelStates& light, const ChannelStates& eye) const {
    return each<ChannelLabels>(light, eye, [&](State q, State r) { return automaton_.label(q, r); });
  }

  // Bit i: a path of this label is in layer first_layer() + i of the film. Label 0 is in none.
  std::uint64_t layer_bits(letters::Automaton::Label label) const { return layer_bits_[label]; }
  std::size_t label_count() const { return layer_bits_.size(); }
  std::uint32_t first_layer() const { return first_layer_; }
  std::uint32_t layer_count() const { return layer_count_; }

 private:
  using State = letters::Automaton::State;
  using Class = letters::Automaton::Class;
  // The classes of a shape's lobes. [0]: reflected, [1]: transmitted.
  struct SurfaceClasses {
    std::array<Class, 2> diffuse{}, glossy{}, specular{};
  };

  template <class Result, class A, class B, class F>
  static Result each(const A& a, const B& b, const F& f) {
    if (a.uniform() && b.uniform()) [[likely]]
      return Result(f(a[0], b[0]));
    Result result;
    for (std::size_t c = 0; c < kColors; ++c) result.put(c, f(a[c], b[c]));
    return result;
  }
  // The shape's classes at the hit: those of the table, or `made`, which depends on regions.
  const SurfaceClasses& classes_at(const SurfaceHit& hit, SurfaceClasses& made) const {
    if (regions_.empty()) [[likely]]
      return of_shape_[hit.shape];
    made = classes_of(hit.shape, regions_at(hit.p));
    return made;
  }
  SurfaceClasses classes_of(std::uint32_t shape, std::uint32_t regions) const;
  ChannelStates at_one_outside(Vec3 d, std::uint64_t key) const;
  ChannelClasses drawn(const SurfaceHit& hit, const scene::Closure& closure, Vec3 wo, Vec3 wi,
                       TransportMode mode, std::uint64_t key, Class diffuse, Class glossy) const;
  std::uint32_t regions_at(Vec3 p) const;

  const letters::Automaton automaton_;
  const scene::Scene& scene_;
  const std::vector<letters::Region> regions_;
  const float glossy_below_;
  const std::uint32_t first_layer_, layer_count_;
  const bool several_outside_;
  std::uint32_t outside_ = scene::kNone;   // the only environment
  std::vector<State> lamp_state_;          // by emitter
  std::vector<SurfaceClasses> of_shape_;   // empty if there are regions
  std::vector<std::uint64_t> layer_bits_;  // by label
};

}  // namespace candela::transport
