// Merges by the labels of their paths.
#pragma once

#include <cstdint>

#include "worker/transport/letters/layer_sums.h"

namespace candela::transport {

// The labels of merges at a vertex of an eye path, or along an edge, if somebody asks for them.
class MergeLetters {
 public:
  // Null: no letters are read.
  explicit MergeLetters(EyeLetters* eye = nullptr) : eye_(eye) {}
  bool any() const { return eye_ != nullptr; }
  // The path is at the vertex, or on the edge.
  void start() {
    if (any()) start_some();
  }
  // A light path of these states merges at v, its light coming from wi, or at p in a medium.
  void add(const ScatterPoint& v, Vec3 wi, const ChannelStates& light, const Spectrum& value);
  void add(std::uint32_t medium, Vec3 p, const ChannelStates& light, const Spectrum& value);
  // All of them, each times `factor`, are `found`, which the path's sum gets.
  void finish(const Spectrum& found, Spectrum& path_sum, const Spectrum& factor) {
    const Spectrum before = path_sum;
    path_sum += found;
    if (any()) finish_some(before, path_sum, factor);
  }

 private:
  void start_some();
  void finish_some(const Spectrum& before, const Spectrum& sum, const Spectrum& factor);
  void add(const ChannelClasses& token, const ChannelStates& light, const Spectrum& value);

  EyeLetters* eye_;
  ChannelStates states_;
  LabelledParts parts_;
};

}  // namespace candela::transport
