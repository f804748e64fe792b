// Light paths whose vertices are splatted on the film: connected to the lens (t = 1), or by meeting it (t =
// 0); and kept in a store for eye paths.
#pragma once

#include <cstdint>
#include <optional>
#include <type_traits>

#include "worker/estimators/light_store.h"
#include "worker/estimators/options.h"
#include "worker/scene/bsdfs/path_edited.h"
#include "worker/scene/objects.h"
#include "worker/transport/letters/layer_sums.h"
#include "worker/transport/light_path.h"
#include "worker/transport/splat.h"
#include "worker/transport/technique/connect_lens.h"
#include "worker/transport/technique/hit_lens.h"

namespace candela::estimators {

struct NoLightEdits {
  explicit NoLightEdits(const scene::Scene& /*scene*/) {}
};
// The walk of a scene with edits that select by more of the path than the vertex.
template <class Store>
struct LightEdits : scene::EditedWalk {
  explicit LightEdits(const scene::Scene& scene)
      : scene::EditedWalk(*scene.objects().path_edits, Store::kKeeps) {}
};

template <transport::EdgeContent kEdgeContent, class Mis, class Store, transport::EtaField Eta>
class LightTracing {
 public:
  static constexpr bool kEdits = requires { requires std::remove_cv_t<Store>::kEdits; };
  using LightWalk = transport::Walk<transport::TransportMode::importance, kEdgeContent, Mis,
                                    samplers::Sampler, typename Store::Observer>;
  using Vertex = typename LightWalk::Vertex;

  // All by reference but the options: they outlive the estimator. image_layer: of the film, which has the
  // connections to the lens by themselves; 0: none. letters: null where nobody asks for layers of
  // expressions.
  LightTracing(const scene::Scene& scene, const PathOptions& options, const Techniques& techniques,
               const PathCounts& counts, const Eta& eta, const transport::Splatter& splatter, Store& store,
               film::SampleCounts& sample_counts, std::uint32_t image_layer = 0,
               const transport::PathLetters* letters = nullptr)
      : scene_(scene),
        factors_(mis_factors<Mis>(techniques, counts)),
        rules_(light_rules(options, techniques, counts)),
        light_image_(techniques.light_image),
        each_(static_cast<float>(1 / counts.light_paths)),
        eta_(eta),
        splatter_(splatter),
        store_(store),
        sample_counts_(sample_counts),
        image_layer_(image_layer),
        edits_(scene) {
    if (transport::reads_letters<kEdgeContent>(letters)) letters_.emplace(*letters);
  }

  // The light path of the sampler.
  void operator()(std::uint64_t /*path*/, samplers::Sampler& sampler) {
    by_specular_ = false;
    LightWalk walk(scene_, rules_, factors_, sampler, sample_counts_, store_.observer());
    transport::follow_light_path(walk, room_, *this);
    crossed(walk);
  }

  // The techniques: see light_path.h.
  void started(const LightWalk& walk) {
    if constexpr (kEdits) edits_.begin_at_lamp(walk.origin().vertex.emitter);
    if (reads_letters()) letters_->begin(walk.origin(), walk.sample_key());
  }
  void met_lens(const LightWalk& walk, std::uint64_t key) {
    transport::FilmPosition film;
    const transport::Contribution found = transport::hit_lens(context_, walk, eta_, film);
    if (!(found.weight > 0)) return;
    Spectrum value = found.weighted() * each_;
    if constexpr (kEdits) value *= edits_.share_at_eye();
    if (reads_letters())
      splatter_.splat_labelled(letters_->letters(), letters_->met_lens(), film, value, rng::combine(key, 2),
                               sample_counts_);
    else
      splatter_.splat(0, film, value, rng::combine(key, 2), sample_counts_);
  }
  bool vertex(const LightWalk& walk, std::conditional_t<kEdits, Vertex, const Vertex>& v, std::uint64_t key) {
    crossed(walk);
    if constexpr (kEdits) {
      if (v.on_surface())
        v.closure = edits_.surface(v.hit, v.closure);
      else
        v.turned = edits_.medium(v.medium, scene_.medium(v.medium).phase(), v.hit.p, v.closure);
    }
    if (!v.connectible) return true;
    // The lens has one edge to come, and a connection to the eye's first vertex two.
    const bool last = v.edges >= rules_.max_edges;
    const transport::ChannelStates* const states = reads_letters() ? &letters_->states() : nullptr;
    if constexpr (kEdits)
      store_.keep(scene_, v, last, by_specular_, sample_counts_, states, edits_);
    else
      store_.keep(scene_, v, last, by_specular_, sample_counts_, states);
    transport::FilmPosition film;
    transport::Contribution found;
    transport::Towards towards;
    if (light_image_ &&
        transport::connect_lens<kEdgeContent, Mis>(context_, walk.draws(), v, eta_, film, found, nullptr,
                                                   reads_letters() ? &towards : nullptr)) {
      Spectrum value = found.weighted() * each_;
      if constexpr (kEdits) {
        if (!v.on_surface()) value *= edits_.medium_share();
      }
      const bool kept =
          reads_letters() ? splatter_.splat_labelled(letters_->letters(), letters_->connected(v, towards.wi),
                                                     film, value, rng::combine(key, 3), sample_counts_)
                          : splatter_.splat(0, film, value, rng::combine(key, 3), sample_counts_);
      if (kept && image_layer_ != 0)
        splatter_.splat(image_layer_, film, value, rng::combine(key, 3), sample_counts_);
    }
    return true;
  }
  bool scattered(const LightWalk& walk, const Vertex& v) {
    by_specular_ = v.left_by_delta;
    if (reads_letters()) letters_->scattered(v, walk.direction());
    if constexpr (kEdits) {
      if (!v.on_surface()) edits_.leave_medium();
    }
    return true;
  }

 private:
  void crossed(const LightWalk& walk) {
    store_.crossed(walk, reads_letters() ? &letters_->states() : nullptr);
  }
  bool reads_letters() const {
    return transport::reads_letters<kEdgeContent>(letters_ ? &*letters_ : nullptr);
  }

  const scene::Scene& scene_;
  const transport::MisFactors factors_;
  const transport::WalkRules rules_;
  const bool light_image_;
  const float each_;
  const Eta& eta_;
  const transport::Splatter& splatter_;
  Store& store_;
  film::SampleCounts& sample_counts_;
  const transport::ConnectContext context_{scene_, factors_, rules_, sample_counts_};
  transport::VertexPair<typename Mis::Block> room_;
  bool by_specular_ = false;
  const std::uint32_t image_layer_;
  std::optional<transport::LightLetters> letters_;
  [[no_unique_address]] std::conditional_t<kEdits, LightEdits<Store>, NoLightEdits> edits_;
};

}  // namespace candela::estimators
