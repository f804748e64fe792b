// Merges with edits that select by more of the path than the vertex (scene/bsdfs/path_edited.h): a photon
// tells the eye's vertex the state of the lamp's end, and takes the share of the eye's state behind the
// vertex.
#pragma once

#include <cstddef>

#include "worker/scene/bsdfs/edited_arrivals.h"
#include "worker/transport/vertex.h"

namespace candela::transport {

struct NoMergeEdits {
  static constexpr bool kEdits = false;
};

class MergeEdits {
 public:
  static constexpr bool kEdits = true;

  // arrivals: of the photons of each map, by their number.
  MergeEdits(const scene::EditedArrivals& surface, const scene::EditedArrivals& medium)
      : surface_(&surface), medium_(&medium) {}

  // The walk of the eye's vertex.
  void start(scene::EditedWalk& at) { at_ = &at; }
  // Photon number i of the map of surfaces, or of media, is merged.
  void meet(const ScatterPoint& v, std::size_t i) {
    of_ = v.on_surface() ? surface_ : medium_;
    photon_ = i;
    at_->towards_photon(of_->state(i));
  }
  // Factors of the merge beside the closure's value, for light from wi, and of one in a medium.
  Spectrum share(Vec3 local_wo, Vec3 local_wi) const {
    return of_->shares(photon_)[at_->own_behind(local_wo, local_wi)];
  }
  Spectrum medium_share() const {
    return at_->medium_share() * of_->shares(photon_)[at_->own_behind_medium()];
  }

 private:
  const scene::EditedArrivals *surface_, *medium_, *of_ = nullptr;
  scene::EditedWalk* at_ = nullptr;
  std::size_t photon_ = 0;
};

}  // namespace candela::transport
