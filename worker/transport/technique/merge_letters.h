// Merges by the labels of their paths.
#pragma once

#include <cstdint>

#include "worker/transport/letters/layer_sums.h"

namespace candela::transport {

// The labels of merges at a vertex of an eye path, or along an edge, if somebody asks for them.
class MergeLetters {
 public:
  // Nobody if null.
  explicit MergeLetters(EyeLetters* eye = nullptr) : eye_(eye) {}
  bool any() const { return eye_ != nullptr; }
  // The path is at the vertex, or on the edge.
  void start() {
    if (!any()) return;
    parts_.clear();
    states_ = eye_->states();
  }
  // A light path of these states merges at v, its light coming from wi.
  void add(const ScatterPoint& v, Vec3 wi, const ChannelStates& light, const Spectrum& value) {
    add(eye_->letters().of(v, wi, TransportMode::radiance, eye_->next_key()), light, value);
  }
  // The same in a medium.
  void add(std::uint32_t medium, Vec3 p, const ChannelStates& light, const Spectrum& value) {
    add(eye_->letters().in_medium(medium, p), light, value);
  }
  // All of them, each times `factor`, are `found`, which the path's sum gets.
  void finish(const Spectrum& found, Spectrum& path_sum, const Spectrum& factor) {
    const Spectrum before = path_sum;
    path_sum += found;
    if (!any()) return;
    eye_->sums().add(before, path_sum, parts_, factor);
    parts_.clear();
  }

 private:
  void add(const ChannelClasses& token, const ChannelStates& light, const Spectrum& value) {
    parts_.add(eye_->letters().labels(light, eye_->letters().from_eye(states_, token)), value);
  }

  EyeLetters* eye_;
  ChannelStates states_;
  LabelledParts parts_;
};

}  // namespace candela::transport
