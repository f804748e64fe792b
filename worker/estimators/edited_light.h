// Light paths with edits that select by more of the path than the vertex (scene/bsdfs/path_edited.h):
// connected to the lens (t = 1), or by meeting it (t = 0), as LightTracing does it without them.
#pragma once

#include <cstdint>

#include "worker/estimators/options.h"
#include "worker/scene/bsdfs/path_edited.h"
#include "worker/transport/light_path.h"
#include "worker/transport/splat.h"
#include "worker/transport/technique/connect_lens.h"
#include "worker/transport/technique/hit_lens.h"

namespace candela::estimators {

template <class Mis>
class EditedLightTracing {
 public:
  static constexpr transport::Between kBetween = transport::Between::media;
  using LightWalk = transport::Walk<transport::TransportMode::importance, kBetween, Mis>;
  using Vertex = typename LightWalk::Vertex;

  // All by reference but the options: they outlive the estimator.
  EditedLightTracing(const scene::Scene& scene, const scene::PathEdits& edits, const PathOptions& options,
                     const Techniques& techniques, const PathCounts& counts,
                     const transport::Splatter& splatter, film::Tallies& tallies)
      : scene_(scene),
        factors_(mis_factors<Mis>(techniques, counts)),
        rules_(light_rules(options, techniques, counts)),
        light_image_(techniques.light_image),
        each_(static_cast<float>(1 / counts.light_paths)),
        splatter_(splatter),
        tallies_(tallies),
        edits_(edits) {}

  // The light path of the sampler.
  void operator()(std::uint64_t /*path*/, samplers::Sampler& sampler) {
    LightWalk walk(scene_, rules_, factors_, sampler, tallies_);
    transport::follow_light_path(walk, room_, *this);
  }

  // The techniques: see light_path.h.
  void started(const LightWalk& walk) { edits_.begin_at_lamp(walk.origin().vertex.emitter); }
  void met_lens(const LightWalk& walk, std::uint64_t key) {
    transport::FilmPosition film;
    const transport::Contribution found = transport::hit_lens(context_, walk, no_merging_, film);
    if (!(found.weight > 0)) return;
    splatter_.splat(0, film, found.weighted() * edits_.share_at_eye() * each_, rng::combine(key, 2),
                    tallies_);
  }
  bool vertex(const LightWalk& walk, Vertex& v, std::uint64_t key) {
    if (v.on_surface())
      v.closure = edits_.surface(v.hit, v.closure);
    else
      edits_.medium(v.medium, v.hit.p);
    if (!v.connectible) return true;
    transport::FilmPosition film;
    transport::Contribution found;
    if (light_image_ &&
        transport::connect_lens<kBetween, Mis>(context_, walk.draws(), v, no_merging_, film, found)) {
      const Spectrum share = v.on_surface() ? Spectrum(1) : edits_.medium_share();
      splatter_.splat(0, film, found.weighted() * share * each_, rng::combine(key, 3), tallies_);
    }
    return true;
  }
  bool scattered(const LightWalk& /*walk*/, const Vertex& v) {
    if (!v.on_surface()) edits_.leave_medium();
    return true;
  }

 private:
  const scene::Scene& scene_;
  const transport::MisFactors factors_;
  const transport::WalkRules rules_;
  const bool light_image_;
  const float each_;
  const transport::ConstantEta no_merging_;
  const transport::Splatter& splatter_;
  film::Tallies& tallies_;
  const transport::ConnectContext context_{scene_, factors_, rules_, tallies_};
  transport::VertexPair<typename Mis::Block> room_;
  scene::EditedWalk edits_;
};

}  // namespace candela::estimators
