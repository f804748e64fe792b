// The ends of light paths as known at vertices that are kept, for edits that select by more of the path than
// the vertex (path_edited.h): the state of the lamp's end, and a share for each state
// of the eye's end.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "worker/scene/bsdfs/path_edited.h"

namespace candela::scene {

class EditedArrivals {
 public:
  using State = EditedWalk::State;

  void clear() {
    states_.clear();
    shares_.clear();
  }
  // The walk, from a lamp, is at a vertex that is kept.
  void keep(const EditedWalk& walk) {
    states_.push_back(walk.arrived_state());
    const std::span<const Spectrum> shares = walk.arrived_shares();
    shares_.insert(shares_.end(), shares.begin(), shares.end());
  }
  // Adds those of another list, of the same scene.
  void add(const EditedArrivals& others) {
    states_.insert(states_.end(), others.states_.begin(), others.states_.end());
    shares_.insert(shares_.end(), others.shares_.begin(), others.shares_.end());
  }

  std::size_t size() const { return states_.size(); }
  State state(std::size_t i) const { return states_[i]; }
  // By state of the eye's end behind the vertex.
  std::span<const Spectrum> shares(std::size_t i) const {
    const std::size_t each = shares_.size() / states_.size();
    return std::span(shares_).subspan(i * each, each);
  }

 private:
  std::vector<State> states_;
  std::vector<Spectrum> shares_;
};

}  // namespace candela::scene
