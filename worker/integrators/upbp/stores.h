// Both sides of an iteration of upbp: what light paths leave, and how eye paths merge with it.
#pragma once

#include <mutex>

#include "worker/estimators/merging_eye.h"
#include "worker/transport/technique/merge_medium.h"

namespace candela::integrators::upbp {

using Photons = estimators::LightStore<transport::MisBlock>;

// Selects the light paths that leave beams: one in `stride`, from a place that is drawn for the iteration, so
// that each path does with probability 1 / stride however paths are stratified.
struct BeamPaths {
  std::uint64_t stride = 1, offset = 0;
  bool has(std::uint64_t path) const { return path % stride == offset; }
};

// Result of one chunk of light paths: vertices and photons as for vcm, and beams. A handle; while it is in
// use it stays where it is.
class BeamStore {
 public:
  using Observer = transport::CrossingObserver;

  // merges: by the number of the medium. path: the chunk's first.
  BeamStore(Photons& photons, transport::BeamBuffer& beams, const scene::Scene& scene,
            const transport::MediumMerges* merges, bool keeps_beams, const BeamPaths& beam_paths,
            std::uint64_t path, std::uint32_t max_edges)
      : photons_(photons),
        beams_(beams),
        scene_(scene),
        merges_(merges),
        keeps_beams_(keeps_beams),
        beam_paths_(beam_paths),
        path_(path),
        max_edges_(max_edges) {}

  Observer observer() {
    crossing_.some = false;
    return Observer(crossing_);
  }
  template <class Walk>
  void crossed(const Walk& walk, const transport::ChannelStates* states) {
    if (!crossing_.some) return;
    crossing_.some = false;
    if (!keeps_beams_ || crossing_.segment.edges > max_edges_ || !beam_paths_.has(path_)) return;
    // A stretch that comes from outside without end lets nothing through that scatters.
    if (!beams_.keep(scene_, crossing_, merges_[crossing_.segment.medium].long_photon_beams,
                     transport::edge_start(walk, crossing_.segment), walk.origin(), states))
      ++rejected_;
  }
  void keep(const scene::Scene& scene, const transport::Vertex<transport::MisBlock>& v, bool last,
            bool by_specular, film::SampleCounts& sample_counts, const transport::ChannelStates* states) {
    photons_.keep(scene, v, last, by_specular, sample_counts, states);
    sample_counts.rejected[static_cast<std::size_t>(film::RejectCause::not_a_number)] += rejected_;
    rejected_ = 0;
  }
  void end_path() {
    photons_.end_path();
    ++path_;
  }

 private:
  Photons& photons_;
  transport::BeamBuffer& beams_;
  const scene::Scene& scene_;
  const transport::MediumMerges* const merges_;
  const bool keeps_beams_;
  const BeamPaths beam_paths_;
  std::uint64_t path_;
  const std::uint32_t max_edges_;  // of light paths
  transport::Crossing crossing_;
  std::uint64_t rejected_ = 0;
};

// The work of merging in media of all threads.
class SharedWork {
 public:
  void add(const transport::MergeWork& work) {
    const std::lock_guard lock(mutex_);
    work_.add(work);
  }
  // No thread adds any more.
  const transport::MergeWork& sum() const { return work_; }

 private:
  std::mutex mutex_;
  transport::MergeWork work_;
};

// The light side of an iteration.
template <class Block, class Field>
struct BeamSide : estimators::LightSide<Block, Field> {
  const transport::MediumMaps& medium;
  SharedWork& work;
};

// The merges in media of VcmEye.
class EyeBeams {
 public:
  static constexpr bool kMerges = true;
  template <class Block, class Field>
  using Side = BeamSide<Block, Field>;
  using Observer = transport::CrossingObserver;

  template <class SideT>
  EyeBeams(const scene::Scene& scene, const estimators::PathOptions& /*options*/, const SideT& side,
           transport::EyeLetters* letters)
      : gather_(scene, side.medium, letters), work_(side.work) {}
  ~EyeBeams() { work_.add(gather_.work()); }
  EyeBeams(const EyeBeams&) = delete;
  EyeBeams& operator=(const EyeBeams&) = delete;

  // A path begins. eta: of all its weights.
  void begin(const transport::MergeFactors& eta) {
    gather_.begin(eta);
    crossing_.some = false;
    shares_ = {};
  }
  Observer observer() { return Observer(crossing_); }
  // These three add to the path's sum what they return.
  template <class Walk>
  Spectrum merge_along(const Walk& walk, Spectrum& path_sum) {
    if (!crossing_.some) return {};
    crossing_.some = false;
    transport::MediumShares found;
    gather_.along(crossing_, transport::edge_start(walk, crossing_.segment), found, path_sum);
    shares_.point_beam += found.point_beam;
    shares_.beam_beam += found.beam_beam;
    return found.point_beam + found.beam_beam;
  }
  // At a vertex that is connectible: the steps of MediumGather.
  void prefetch(const transport::Vertex<transport::MisBlock>& v) const { gather_.prefetch(v); }
  Spectrum start(const transport::Vertex<transport::MisBlock>& v, Spectrum& path_sum) {
    gather_.start(v);
    const Spectrum found = gather_.beams_at(v, path_sum);
    shares_.beam_point += found;
    return found;
  }
  Spectrum finish(Spectrum& path_sum) {
    const Spectrum found = gather_.finish(path_sum);
    shares_.point_point += found;
    return found;
  }
  // Shares of the path so far.
  const transport::MediumShares& shares() const { return shares_; }

 private:
  transport::MediumGather gather_;
  SharedWork& work_;
  transport::Crossing crossing_;
  transport::MediumShares shares_;
};

}  // namespace candela::integrators::upbp
