// Bsdfs along one walk, of which edits select some by more of the path than the vertex [docs/edits.md;
// retargeting note, section 7].
//
// A walk knows the state of the end that it comes from: of edits of the eye if it comes from the eye, of
// light's if from a lamp. Their verdict at a vertex is known. The verdict of the others depends on the state
// of the other end, which lies before the walk: the walk carries a weight for each of these states q,
//   b[q] = 1 at the start;   b'[q] = f'_v(i -> o) / p b[delta(q, t)],   v = verdict(q, t),   t: the vertex's
//   token,
// in which p is one density for all q. The throughput of the walk is the largest of them in each channel, and
// a share is what b[q] is of it. At its end, a lamp or the lens, the walk takes the share of that end's
// state.
//
// The direction is drawn from all alternatives: the branches of the walk's own direction under the edits of
// each state, the direction itself among them. So p is positive wherever any of the values is.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/edits/path_states.h"
#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/edited.h"
#include "worker/scene/bsdfs/surface.h"
#include "worker/scene/hit.h"
#include "worker/scene/media/phase.h"
#include "worker/scene/objects.h"

namespace candela::scene {

// Edits of a scene, which must outlive this object.
struct PathEdits {
  edits::PathStates of_light, of_eye;
  const SceneEdits* edits;
  const SceneObjects* objects;
  std::vector<bool> scatters;  // by shape: it can be a vertex, which surfaces that only pass light on cannot
  // A surface that scatters by diffuse and glossy lobes at once, of which states edit different shares: a
  // letter cannot be drawn there before the states are known. Empty: there is none.
  std::string mixed = {};
};

// The vertex of a walk, and the edge on from there.
class EditedWalk {
 public:
  using State = edits::PathStates::State;

  // weighed: walks from both ends are weighted against each other. Densities are then the same functions in
  // both, and depend on no verdict: they count the edits of all states as alternatives.
  explicit EditedWalk(const PathEdits& all, bool weighed = false) : all_(all), weighed_(weighed) {}

  void begin_at_eye() { begin(false, all_.of_eye.at_eye()); }
  void begin_at_lamp(std::uint32_t emitter) { begin(true, at_lamp(emitter)); }
  // Goes on where another walk has left its vertex.
  void follow(const EditedWalk& before) {
    from_light_ = before.from_light_;
    left_ = before.left_;
  }

  // The closure at the next vertex, from what the scene has there. It is good until the next vertex. Sampling
  // it leaves the vertex; sampling a lobe that passes straight does not.
  Closure surface(const SurfaceHit& hit, const Closure& plain);
  // The next vertex lies in a medium. False: nothing is edited there in any state, and `out` is left as it
  // is. True: `out` is its closure, as that of a surface is, in directions of the world.
  bool medium(std::uint32_t medium, const Phase& phase, Vec3 p, Closure& out);
  // Once the walk has left it.
  void leave_medium();

  // Sets the other end of the connection: all that its closure evaluates from now on holds for that. The
  // other end of a light path is the eye unless told otherwise.
  void towards_lamp(std::uint32_t emitter) { set_other(at_lamp(emitter)); }
  void towards_eye() { set_other(all_.of_eye.at_eye()); }
  // A vertex of a walk from the other end, which lies along the direction d (unit, world) of this vertex, and
  // whose wo is towards where that walk came from.
  void towards(const EditedWalk& end, Vec3 wo, Vec3 d);
  // The other end is a photon that arrives at the vertex: a light path whose state before it is `light`.
  void towards_photon(State light) { set_other(light); }
  // The walk's own state behind the vertex, if it goes on along wi (local), or is in a medium.
  State own_behind(Vec3 wo, Vec3 wi) const {
    return own().next(arrived_.own, own_classes()[letter_][through(wo, wi)]);
  }
  State own_behind_medium() const { return own().next(arrived_.own, own_medium_); }
  // The state and the shares with which the walk arrived at the vertex; a walk from the light may have kept
  // them, and its next vertex is then the one that it arrived at.
  State arrived_state() const { return arrived_.own; }
  std::span<const Spectrum> arrived_shares() const { return {arrived_.share.data(), others().size()}; }
  void arrive_from_light(State own, std::span<const Spectrum> shares) {
    from_light_ = true;
    left_.own = own;
    std::copy(shares.begin(), shares.end(), left_.share.begin());
  }
  // Share of a connection of the vertex in the medium, beside the value of its closure if it has one.
  Spectrum medium_share() const {
    return plain_ ? arrived_.share[others().next(other_, medium_)] : Spectrum(1);
  }
  // Shares of the edge under way that ends at the lamp, and at the lens.
  Spectrum share_at_lamp(std::uint32_t emitter) const { return left_.share[at_lamp(emitter)]; }
  Spectrum share_at_eye() const { return left_.share[all_.of_eye.at_eye()]; }

  // The same of the closure.
  ClosureTraits traits() const;
  Spectrum eval_pdf(Vec3 wo, Vec3 wi, TransportMode mode, const float* diffuse_below, float& pdf) const;
  bool sample(Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out);
  Spectrum passthrough(Vec3 wo) const { return nested_.passthrough(wo); }

 private:
  using Class = edits::PathStates::Class;
  using Classes = std::array<std::array<Class, 2>, 3>;  // [lobe][transmitted]
  enum Lobe : std::uint8_t { diffuse, glossy, delta };
  using Shares = std::array<Spectrum, edits::PathStates::kMax>;
  struct Edge {
    State own = 0;  // of the walk's end
    Shares share;   // by state of the other end
  };
  struct Alternatives;

  void begin(bool from_light, State own);
  void set_other(State other) {
    other_ = other;
    any_end_ = false;
  }
  const edits::PathStates& own() const { return from_light_ ? all_.of_light : all_.of_eye; }
  const edits::PathStates& others() const { return from_light_ ? all_.of_eye : all_.of_light; }
  const Classes& own_classes() const { return from_light_ ? light_ : eye_; }
  const Classes& others_classes() const { return from_light_ ? eye_ : light_; }
  State at_lamp(std::uint32_t emitter) const {
    return all_.of_light.at_lamp(all_.objects->of_emitter[emitter]);
  }
  bool is_own(TransportMode mode) const { return (mode == TransportMode::importance) == from_light_; }
  std::uint32_t regions_at(Vec3 p) const;
  SurfaceEdits::Treatments treatments(State other) const;
  bool through(Vec3 wo, Vec3 wi) const { return dot(wo, base_.ng) * dot(wi, base_.ng) < 0; }
  // verdict: that of the edits with the walk is known, which is then of this walk's kind.
  void find_alternatives(Vec3 wo, TransportMode mode, bool verdict, Alternatives& out) const;
  double density(Vec3 wo, Vec3 wi, TransportMode mode, bool verdict) const;
  double density(const Alternatives& all, Vec3 wo, Vec3 wi, TransportMode mode) const;
  Spectrum value(State other, Vec3 wo, Vec3 wi, TransportMode mode, const float* diffuse_below) const;
  Spectrum any_value(Vec3 wo, Vec3 wi, TransportMode mode, const float* diffuse_below) const;
  bool sample_delta(const Alternatives& all, std::uint32_t drawn, Vec3 wo, Vec3 meant, TransportMode mode,
                    BsdfSample& out);
  // Leaves the vertex with `weights`, by states of the other end.
  void leave(const Shares& weights, Lobe lobe, bool transmitted, BsdfSample& out);

  const PathEdits& all_;
  const bool weighed_;
  bool from_light_ = false;
  Edge arrived_, left_;
  State other_ = 0;       // of the end that the vertex is connected to
  bool any_end_ = false;  // the walk left the vertex, and no end is set since: letters are drawn of all ends
  bool in_medium_ = false;

  // The vertex at hand.
  Closure nested_;
  EditedClosure base_{};  // without treatments
  bool plain_ = true;     // no state has an edit here
  // True: all lobes that are not delta have one letter, which tells states apart; else they lead to the
  // same states.
  bool one_letter_ = false;
  Lobe letter_ = diffuse;
  Class medium_ = 0, own_medium_ = 0;
  Classes light_{}, eye_{};
};

struct PathEditedClosure {
  EditedWalk* walk;

  ClosureTraits traits() const { return walk->traits(); }
};
Spectrum eval_pdf(const PathEditedClosure& e, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf);
Spectrum eval_diffuse(const PathEditedClosure& e, Vec3 wo, Vec3 wi, TransportMode mode, float glossy_below);
bool sample(const PathEditedClosure& e, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out);
Spectrum passthrough(const PathEditedClosure& e, Vec3 wo);

// A row of the list of kinds for the closure alone: no scene has it.
struct PathEditedSurface {
  using ClosureType = PathEditedClosure;
  static constexpr std::array<std::string_view, 0> kPlugins = {};

  static Result<void> build(const description::Object& object, const BuildContext& context);
  static void prepare(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, Closure& out);
  static BsdfFacts facts() { return {}; }
  static std::uint32_t arena_parts() { return 0; }
  template <class Visitor>
  static void for_each_part(const Visitor& /*visit*/) {}
};

}  // namespace candela::scene
