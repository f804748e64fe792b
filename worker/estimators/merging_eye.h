// The eye paths of the merging family. Both follow a path along a ray and return its radiance; one object
// serves many paths of a thread.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string_view>
#include <type_traits>
#include <vector>

#include "worker/estimators/light_store.h"
#include "worker/estimators/options.h"
#include "worker/transport/eye_path.h"
#include "worker/transport/technique/connect.h"
#include "worker/transport/technique/hit_light.h"
#include "worker/transport/technique/merge.h"
#include "worker/transport/technique/merge_medium.h"
#include "worker/transport/technique/next_event.h"
#include "worker/transport/technique/repeated_merges.h"

namespace candela::estimators {

struct EditedLight;  // edited_light_store.h

// The light side of an iteration, as eye paths see it.
template <class Block, transport::ScaleField Field>
struct LightSide {
  transport::MergeMaps<Block> maps;
  const std::vector<LightStore<Block>>& chunks;
  std::uint64_t path_count;
  Field field;
  const transport::PathLetters* letters = nullptr;  // null: nobody asks
  const EditedLight* edits = nullptr;               // for estimators with edits
};

// With edits that select by more of the path than the vertex (edited_subpaths.h). The eye's vertices take two
// places in turn there, as in a VertexPair: merges at a vertex end after the walk has left it.
template <bool kEdits>
struct EditedSubpaths;
struct NoSubpathEdits {
  explicit NoSubpathEdits(const scene::Scene& /*scene*/) {}
};
template <bool kEdits>
using SubpathEdits = std::conditional_t<kEdits, EditedSubpaths<kEdits>, NoSubpathEdits>;
template <bool kEdits>
using MergeEdits = std::conditional_t<kEdits, transport::MergeEdits, transport::NoMergeEdits>;
// The photons of one side.
template <bool kEdits, class Side>
MergeEdits<kEdits> merge_edits([[maybe_unused]] const Side& side) {
  if constexpr (kEdits)
    return {side.edits->surface, side.edits->medium};
  else
    return {};
}

// Merges of beams, as VcmEye asks for them.
struct NoBeams {
  static constexpr bool kMerges = false;
  template <class Block, class Field>
  using Side = LightSide<Block, Field>;
  using Observer = transport::NoObserver;
  static Observer observer() { return {}; }

  template <class Side>
  NoBeams(const scene::Scene& /*scene*/, const PathOptions& /*options*/, const Side& /*side*/,
          transport::EyeLetters* /*letters*/) {}
};

// vcm and bpm: every vertex meets light by itself (s = 0), by next event estimation (s = 1), by connection to
// the vertices of one light path, and by merging with the photons of all; all weighted against each other.
// Beams: NoBeams, or what merges with beams and in media (integrators/upbp). kEditsT: with edits that select
// by more of the path than the vertex (edited_subpaths.h); its side has theirs.
template <transport::EdgeContent kEdgeContent, class MisT, transport::ScaleField Field,
          class StatisticsT = transport::NoStatistics, class Beams = NoBeams, bool kEditsT = false>
class VcmEye : public transport::EyeTechniques {
 public:
  static constexpr bool kEdits = kEditsT;
  using Mis = MisT;
  using Block = typename Mis::Block;
  using Statistics = StatisticsT;
  using EyeWalk = transport::Walk<transport::TransportMode::radiance, kEdgeContent, Mis, samplers::Sampler,
                                  typename Beams::Observer>;
  using Vertex = typename EyeWalk::Vertex;
  using Side = typename Beams::template Side<Block, Field>;

  VcmEye(const scene::Scene& scene, const PathOptions& options, const Techniques& techniques,
         const PathCounts& counts, const Side& side, const Statistics& statistics,
         film::SampleCounts& sample_counts)
      : scene_(scene),
        options_(options),
        techniques_(techniques),
        factors_(mis_factors<Mis>(techniques, counts)),
        rules_(eye_rules(options, techniques, counts)),
        side_(side),
        sample_counts_(sample_counts),
        letters_(transport::eye_letters<kEdgeContent>(side.letters)),
        gather_(scene, side.maps, statistics, letters_ ? &*letters_ : nullptr, merge_edits<kEdits>(side)),
        beams_(scene, options, side, letters_ ? &*letters_ : nullptr),
        edits_(scene) {}

  // The ray goes through this place on the film; light_path is that to connect to.
  Spectrum trace(const Ray& ray, transport::FilmPosition at, std::uint64_t light_path,
                 samplers::Sampler& sampler) {
    const transport::MergeScale& scale = side_.field.at(at);
    eta_ = scale.eta;
    gather_.begin(scale, at);
    if constexpr (Beams::kMerges) beams_.begin(eta_);
    scale_ = &scale;
    counts_repeats_ = Statistics::kCollects && transport::counts_repeats(sampler.sample_key());
    sum_ = merged_ = connected_ = merged_on_surfaces_ = {};
    light_path_ = light_path;
    loaded_ = false;
    if (reads_letters()) letters_->begin(sampler.sample_key(), ray);
    if constexpr (kEdits) edits_.begin_eye();
    EyeWalk walk(scene_, rules_, factors_, sampler, sample_counts_, beams_.observer());
    transport::follow_eye_path(walk, ray, room_, *this);
    crossed(walk);
    merge();
    return sum_;
  }

  // Statistics of the path that was traced last.
  const Statistics& statistics() const { return gather_.statistics(); }
  Spectrum merged() const { return merged_; }
  // The same by half the radius, of photons alone; without beams.
  Spectrum merged_within_half() const { return gather_.inner(); }
  transport::LayerSums* layer_sums() { return reads_letters() ? &letters_->sums() : nullptr; }
  // The shares of techniques in it, in the order of kTechniqueLayers. The rest is light met by chance.
  std::array<Spectrum, 6> shares() const requires(Beams::kMerges) {
    const transport::MediumShares& m = beams_.shares();
    return {connected_, merged_on_surfaces_, m.point_point, m.point_beam, m.beam_point, m.beam_beam};
  }

  // The techniques: see eye_path.h.
  void arrived(const EyeWalk& walk, const Vertex& v, const Vertex* before, bool left) {
    gather_.collect();  // for the vertex before
    crossed(walk);
    transport::Contribution found;
    if (techniques_.hit_light && v.edges >= options_.min_edges &&
        transport::hit_light<Mis>(context_, v, left, before, eta_, found)) {
      if constexpr (kEdits) found.value *= edits_.share_at_light(v, left);
      sum_ += found.weighted();
      if (reads_letters()) letters_->met(sum_, v, left);
    }
  }
  bool vertex(const EyeWalk& walk, std::conditional_t<kEdits, Vertex, const Vertex>& v) {
    if constexpr (kEdits) edits_.eye_vertex(place_ ^= 1, v);
    if (v.connectible) prefetch(v);
    transport::Contribution found;
    transport::Towards towards;
    if (v.connectible && v.edges < options_.max_depth) {
      if (techniques_.next_event && light_directly(walk, v, found, towards)) {
        add_connected(found.weighted());
        if (reads_letters()) letters_->lit(sum_, v, towards);
      }
      if (techniques_.connect && v.edges + 2 <= options_.max_depth) connect_all(walk, v);
    }
    merge();
    if constexpr (kEdits) gather_.edits().start(edits_.eye_walk(place_));
    if (v.connectible) start(v);
    if constexpr (Statistics::kCollects)
      if (v.connectible && counts_repeats_) transport::count_repeats(side_.maps, *scale_, v, sample_counts_);
    return true;
  }
  bool scattered(const EyeWalk& walk, const Vertex& v) {
    if (reads_letters()) letters_->scattered(v, walk.direction());
    if constexpr (kEdits) edits_.leave_eye(place_, v);
    return true;
  }
  void passed() { merge(); }  // the next vertex takes this one's place

 private:
  bool reads_letters() const {
    return transport::reads_letters<kEdgeContent>(letters_ ? &*letters_ : nullptr);
  }

  // The steps of merging.
  void prefetch(const Vertex& v) const {
    gather_.prefetch(v);
    if constexpr (Beams::kMerges) beams_.prefetch(v);
  }
  void start(const Vertex& v) {
    gather_.start(v);
    if constexpr (Beams::kMerges) merged_ += beams_.start(v, sum_);
  }
  void merge() {
    const Spectrum found = gather_.finish(sum_);
    merged_ += found;
    if constexpr (Beams::kMerges) {
      merged_on_surfaces_ += found;
      merged_ += beams_.finish(sum_);
    }
  }
  void add_connected(const Spectrum& found) {
    sum_ += found;
    if constexpr (Beams::kMerges) connected_ += found;
  }
  void crossed([[maybe_unused]] const EyeWalk& walk) {
    if constexpr (Beams::kMerges) merged_ += beams_.merge_along(walk, sum_);
  }
  bool light_directly(const EyeWalk& walk, const Vertex& v, transport::Contribution& found,
                      transport::Towards& towards) {
    if constexpr (kEdits) {
      const auto next_event = [&] {
        return transport::next_event<kEdgeContent, Mis>(context_, walk.draws(), v, eta_, found, nullptr,
                                                        &towards);
      };
      return edits_.light_directly(place_, v, next_event, found, towards);
    } else {
      return transport::next_event<kEdgeContent, Mis>(context_, walk.draws(), v, eta_, found, nullptr,
                                                      reads_letters() ? &towards : nullptr);
    }
  }
  // The first vertex that connects asks for the longest light paths.
  void load(const Vertex& v) {
    loaded_ = true;
    const std::uint32_t below = options_.max_depth - v.edges;
    auto* const states = reads_letters() ? &light_states_ : nullptr;
    if constexpr (kEdits)
      load_light_path(side_.chunks, scene_, light_path_, below, light_, states,
                      [&](std::uint32_t i, std::uint32_t kept, transport::ScatterPoint& z) {
                        edits_.kept_light_vertex(i, side_.edits->chunks[light_path_ / kLightChunk].vertices,
                                                 kept, z);
                      });
    else
      load_light_path(side_.chunks, scene_, light_path_, below, light_, states);
  }
  void connect_all(const EyeWalk& walk, const Vertex& v) {
    if (!loaded_) load(v);
    const std::uint64_t passage = transport::passage_key<kEdgeContent>(context_, walk.draws());
    transport::Contribution found;
    for (std::uint32_t i = 0; i < light_.size(); ++i) {
      const Vertex& z = light_[i];
      if (z.edges + v.edges + 1 > options_.max_depth) break;
      if constexpr (kEdits) edits_.join(i, z, place_, v);
      if (!transport::connect<kEdgeContent, Mis>(context_, z, v, rng::combine(passage, i + 1), eta_, found))
        continue;
      if constexpr (kEdits) found.value *= edits_.light_share(i, z) * edits_.eye_share(place_, v);
      add_connected(found.weighted());
      if (reads_letters()) letters_->connected(sum_, v, z, light_states_[i]);
    }
  }

  const scene::Scene& scene_;
  const PathOptions& options_;
  const Techniques& techniques_;
  const transport::MisFactors factors_;
  const transport::WalkRules rules_;
  const Side& side_;
  film::SampleCounts& sample_counts_;
  const transport::ConnectContext context_{scene_, factors_, rules_, sample_counts_};
  transport::VertexPair<Block> room_;
  transport::Subpath<Block> light_;
  std::optional<transport::EyeLetters> letters_;
  std::vector<transport::ChannelStates> light_states_;  // of light_
  transport::Gather<Mis, Statistics, Block, kEdgeContent == transport::EdgeContent::media, MergeEdits<kEdits>>
      gather_;
  [[no_unique_address]] Beams beams_;
  [[no_unique_address]] SubpathEdits<kEdits> edits_;
  // The path under way.
  transport::MergeFactors eta_;
  const transport::MergeScale* scale_ = nullptr;
  Spectrum sum_, merged_, connected_, merged_on_surfaces_;
  std::uint64_t light_path_ = 0;
  bool loaded_ = false, counts_repeats_ = false;
  std::uint32_t place_ = 0;  // of the vertex at hand, for edits
};

// Decides which eye paths of ppm go on. sharp: directions of high density are the walk's.
struct PpmWalk {
  bool sharp = false;

  // From a vertex that is connectible.
  bool goes_on(const transport::ScatterPoint& v) const {
    return v.on_surface() ? v.closure.has_delta_lobes() || (sharp && !v.closure.even()) : sharp;
  }
  // In the direction in which the walk left v.
  bool follows(const transport::ScatterPoint& v) const { return sharp ? v.left_sharply : v.left_by_delta; }
};

// ppm: the walk goes on where it is reflected or refracted specularly, by a delta lobe or in a direction of
// density above kSharpDensity. All else that a vertex scatters is estimated by merging where it is met: so
// the walk ends there. Each path is found in one way, since the density is a function of the vertex and both
// directions.
template <transport::EdgeContent kEdgeContent, transport::ScaleField Field,
          class StatisticsT = transport::NoStatistics, bool kEditsT = false>
class PpmEye : public transport::EyeTechniques {
 public:
  static constexpr bool kEdits = kEditsT;
  using Mis = transport::Unweighted;
  using Block = typename Mis::Block;
  using Statistics = StatisticsT;
  using EyeWalk = transport::Walk<transport::TransportMode::radiance, kEdgeContent, Mis>;
  using Vertex = typename EyeWalk::Vertex;

  PpmEye(const scene::Scene& scene, const PathOptions& options, const Techniques& techniques,
         const PathCounts& counts, const LightSide<Block, Field>& side, const Statistics& statistics,
         film::SampleCounts& sample_counts)
      : scene_(scene),
        options_(options),
        techniques_(techniques),
        rules_(eye_rules(options, techniques, counts)),
        side_(side),
        sample_counts_(sample_counts),
        walk_{std::isfinite(side.maps.max_density)},
        letters_(transport::eye_letters<kEdgeContent>(side.letters)),
        gather_(scene, side.maps, statistics, letters_ ? &*letters_ : nullptr, merge_edits<kEdits>(side)),
        edits_(scene) {}

  // MergeMaps::max_density in the scene: kSharpDensity, or infinity if no density is higher.
  static float max_density(const scene::Scene& scene) {
    // Kinds without lobes between delta and diffuse.
    constexpr std::string_view kOthers[] = {
        "diffuse",   "roughdiffuse", "difftrans",  "null",           "mask",    "blendbsdf", "bumpmap",
        "normalmap", "conductor",    "dielectric", "thindielectric", "plastic", "coating"};
    bool sharp = std::ranges::any_of(scene.features().bsdf_kinds, [&](const auto& kind) {
      return std::ranges::find(kOthers, kind.first) == std::end(kOthers);
    });
    for (std::uint32_t m = 0; m < scene.features().media; ++m) {
      const scene::Phase& phase = scene.medium(m).phase();
      constexpr Vec3 kAhead{0, 0, 1};
      sharp = sharp || std::max(phase.pdf_solid_angle(kAhead, kAhead),
                                phase.pdf_solid_angle(kAhead, -kAhead)) > transport::kSharpDensity;
    }
    return sharp ? transport::kSharpDensity : std::numeric_limits<float>::infinity();
  }

  Spectrum trace(const Ray& ray, transport::FilmPosition at, std::uint64_t /*light_path*/,
                 samplers::Sampler& sampler) {
    scale_ = &side_.field.at(at);
    gather_.begin(*scale_, at);
    counts_repeats_ = Statistics::kCollects && transport::counts_repeats(sampler.sample_key());
    sum_ = merged_ = {};
    if (reads_letters()) letters_->begin(sampler.sample_key(), ray);
    if constexpr (kEdits) edits_.begin_eye();
    EyeWalk walk(scene_, rules_, factors_, sampler, sample_counts_);
    transport::follow_eye_path(walk, ray, room_, *this);
    return sum_;
  }

  // Statistics of the path that was traced last.
  const Statistics& statistics() const { return gather_.statistics(); }
  Spectrum merged() const { return merged_; }
  // The same by half the radius, of photons alone; without beams.
  Spectrum merged_within_half() const { return gather_.inner(); }
  transport::LayerSums* layer_sums() { return reads_letters() ? &letters_->sums() : nullptr; }

  // The techniques: see eye_path.h.
  void arrived(const EyeWalk& /*walk*/, const Vertex& v, const Vertex* /*before*/, bool left) {
    transport::Contribution found;
    if (techniques_.hit_light && v.edges >= options_.min_edges &&
        transport::hit_light<Mis>(context_, v, left, nullptr, {}, found)) {
      if constexpr (kEdits) found.value *= edits_.share_at_light(v, left);
      sum_ += found.value;
      if (reads_letters()) letters_->met(sum_, v, left);
    }
  }
  bool vertex(const EyeWalk& /*walk*/, std::conditional_t<kEdits, Vertex, const Vertex>& v) {
    if constexpr (kEdits) {
      edits_.eye_vertex(place_ ^= 1, v);
      gather_.edits().start(edits_.eye_walk(place_));
    }
    if (!v.connectible) return true;
    gather_.start(v);
    if constexpr (Statistics::kCollects)
      if (counts_repeats_) transport::count_repeats(side_.maps, *scale_, v, sample_counts_);
    merged_ += gather_.finish(sum_);
    return walk_.goes_on(v);
  }
  bool scattered(const EyeWalk& walk, const Vertex& v) {
    if (reads_letters()) letters_->scattered(v, walk.direction());
    if constexpr (kEdits) edits_.leave_eye(place_, v);
    return walk_.follows(v);
  }

 private:
  bool reads_letters() const {
    return transport::reads_letters<kEdgeContent>(letters_ ? &*letters_ : nullptr);
  }

  const scene::Scene& scene_;
  const PathOptions& options_;
  const Techniques& techniques_;
  const transport::MisFactors factors_;
  const transport::WalkRules rules_;
  const LightSide<Block, Field>& side_;
  film::SampleCounts& sample_counts_;
  const PpmWalk walk_;
  const transport::ConnectContext context_{scene_, factors_, rules_, sample_counts_};
  transport::VertexPair<Block> room_;
  std::optional<transport::EyeLetters> letters_;
  transport::Gather<Mis, Statistics, Block, kEdgeContent == transport::EdgeContent::media, MergeEdits<kEdits>>
      gather_;
  [[no_unique_address]] SubpathEdits<kEdits> edits_;
  // The path under way.
  const transport::MergeScale* scale_ = nullptr;
  bool counts_repeats_ = false;
  std::uint32_t place_ = 0;  // of the vertex at hand, for edits
  Spectrum sum_, merged_;
};

}  // namespace candela::estimators
