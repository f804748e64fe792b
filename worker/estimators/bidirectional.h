// The work for one path from the light and one from the eye: every way to join them. A path of s vertices
// from the light and t from the eye has s + t - 1 edges:
//   s = 0         the eye's walk meets light                   t = 0   a light path meets a finite lens
//   s = 1         next event estimation                        t = 1   connection to the lens: a splat
//   s, t >= 2     connection of a light and an eye vertex
// Light seen directly (one edge) is left to s = 0, which finds it without noise.
//
// A sink takes what is found: a film, or a chain's list.
#pragma once

#include <cstdint>
#include <optional>
#include <type_traits>
#include <vector>

#include "worker/estimators/mollified_paths.h"
#include "worker/estimators/options.h"
#include "worker/scene/scene.h"
#include "worker/transport/eye_path.h"
#include "worker/transport/letters/layer_sums.h"
#include "worker/transport/light_path.h"
#include "worker/transport/subpath.h"
#include "worker/transport/technique/connect.h"
#include "worker/transport/technique/connect_lens.h"
#include "worker/transport/technique/hit_lens.h"
#include "worker/transport/technique/hit_light.h"
#include "worker/transport/technique/next_event.h"
#include "worker/transport/technique_list.h"

namespace candela::estimators {

// Every technique of every length.
struct EveryTechnique {
  static constexpr bool wants(std::uint32_t, std::uint32_t) { return true; }
  static constexpr bool light_goes_on(std::uint32_t) { return true; }
  static constexpr bool eye_goes_on(std::uint32_t) { return true; }
};

// One: paths of s vertices from the light and t from the eye.
struct OneTechnique {
  std::uint32_t s = 0, t = 0;
  bool wants(std::uint32_t s_, std::uint32_t t_) const { return s == s_ && t == t_; }
  // Beyond a vertex of so many edges. (One that is passed straight is not behind.)
  bool light_goes_on(std::uint32_t edges) const { return edges + 1 < s; }
  bool eye_goes_on(std::uint32_t edges) const { return edges + 1 < t; }
};

// A configuration for images: all techniques, numbers of a sampler.
template <transport::EdgeContent kB, class MisT, class SinkT, bool kL = false>
struct BidirectionalConfig {
  static constexpr transport::EdgeContent kEdgeContent = kB;
  static constexpr bool kLists = kL;
  using Mis = MisT;
  using Sampler = samplers::Sampler;
  using Sink = SinkT;
  using Choice = EveryTechnique;
};

// Both subpaths for kernels with edits that select by more of the path than the vertex
// (scene/bsdfs/path_edited.h).
template <bool kEdits>
struct EditedSubpaths {
  explicit EditedSubpaths(const scene::Scene& /*scene*/) {}
};

// True of a sink with `static constexpr bool kRecordsPaths = true` and
//   light_started(origin, key)           light left a lamp: a light path, key is its name
//   met(eye, v, left)                    s = 0: light at v, the vertex at hand of the eye path
//   lit(eye, v, draws)                   s = 1: next event estimation at v, by these draws
//   connected(eye, v, light, z)
//   to_lens(light, z, wi, film)          t = 1: from z along wi
//   met_lens(light, wi, film)            t = 0: from the last vertex along wi
// Precondition of each: the subpaths and the vertex are as the call gives them, until it returns.
template <class Sink>
concept RecordsPaths = Sink::kRecordsPaths;

// Config: kEdgeContent; kEdits, which may be left out: with EditedSubpaths; kLetters, likewise: with letters
// for layers by expressions, which kernels for media always have; Mis; kLists: heuristics that need all
// densities, Mis is Balance then; Sampler; Choice: one of the above; Sink, with
//   eye(contribution, s, t)              techniques of t >= 2: along the eye's ray
//   sum()                                of these, so far
//   light(contribution, s, t, at, key, letters, labels)
//                                        t < 2: to be divided by the number of light paths. labels: of the
//                                        path; null where nobody asks for layers of expressions
// BidirectionalConfig has the usual ones. A sink that records paths is shown the subpaths of a contribution
// just before it; see RecordsPaths. A configuration may mollify paths that no technique can sample; see
// Mollifying. Its plan has light paths.
template <class Config>
class Bidirectional {
 public:
  static constexpr transport::EdgeContent kEdgeContent = Config::kEdgeContent;
  static constexpr bool kLists = Config::kLists;
  static constexpr bool kRecords = RecordsPaths<typename Config::Sink>;
  static constexpr bool kMollifies = Mollifying<Config>;
  static constexpr bool kEdits = requires { requires Config::kEdits; };
  static constexpr bool kLetters = kEdgeContent == transport::EdgeContent::media || requires {
    requires Config::kLetters;
  };
  using Mis = typename Config::Mis;
  using Sampler = typename Config::Sampler;
  using Sink = typename Config::Sink;
  using Choice = typename Config::Choice;
  using EyeWalk = transport::Walk<scene::TransportMode::radiance, kEdgeContent, Mis, Sampler>;
  using LightWalk = transport::Walk<scene::TransportMode::importance, kEdgeContent, Mis, Sampler>;
  using Vertex = typename EyeWalk::Vertex;

  Bidirectional(const scene::Scene& scene, const PathOptions& options, const Techniques& techniques,
                const PathCounts& counts, Sink& sink, film::SampleCounts& sample_counts,
                const transport::PathLetters* letters = nullptr)
      : scene_(scene),
        options_(options),
        techniques_(techniques),
        sink_(sink),
        sample_counts_(sample_counts),
        factors_(mis_factors<Mis>(techniques, counts)),
        eye_rules_(eye_rules(options, techniques, counts)),
        light_rules_(light_rules(options, techniques, counts)),
        passes_(scene.features().any_passthrough || scene.features().media > 0),
        edits_(scene),
        path_letters_(letters) {
    if (!kLetters || letters == nullptr) return;
    eye_letters_.emplace(*letters);
    light_letters_.emplace(*letters);
  }

  // The light path of the sampler, kept.
  void trace_light(Sampler& sampler) {
    ++sample_counts_.light_paths;
    light_states_.clear();
    if constexpr (kMollifies) mollified_.clear_light();
    LightWalk walk(scene_, light_rules_, factors_, sampler, sample_counts_);
    LightSide at{*this, light_context_};
    transport::follow_light_path(walk, light_, at);
  }
  // No light path: there are no light vertices to connect to.
  void no_light() {
    light_.clear();
    if constexpr (kMollifies) mollified_.clear_light();
  }
  // No vertex of the light path can be connected to.
  bool no_light_vertices() const {
    if constexpr (kMollifies)
      if (mollified_.any_light_end()) return false;
    return light_.size() == 0;
  }
  // Labelled sums of the last eye path, whose sum the sink has; null: the job has no expressions.
  transport::LayerSums* layer_sums() { return reads_letters() ? &eye_letters_->sums() : nullptr; }
  // The eye path along a ray.
  void trace_eye(const Ray& ray, Sampler& sampler) {
    if constexpr (kEdits) edits_.begin_eye();
    if (reads_letters()) eye_letters_->begin(sampler.sample_key(), ray);
    if constexpr (kMollifies) mollified_.eye_started(eye_context_, ray);
    EyeWalk walk(scene_, eye_rules_, factors_, sampler, sample_counts_);
    EyeSide at{{}, *this, eye_context_};
    transport::follow_eye_path(walk, ray, eye_, at);
  }

  // The bandwidth of the paths to come.
  void set_bandwidth(double bandwidth) { mollified_.set_bandwidth(bandwidth); }

  // The paths to come are those of this choice, all of which have s + t - 1 edges.
  void choose(const Choice& choice) {
    choice_ = choice;
    eye_rules_.max_edges = choice.s + choice.t - 1;
    light_rules_.max_edges = eye_rules_.max_edges - 1;
  }

 private:
  struct LightSide;
  struct EyeSide;

  bool reads_letters() const {
    if constexpr (kLetters) return eye_letters_.has_value();
    return false;
  }
  void to_light_sink(const transport::Contribution& found, std::uint32_t s, std::uint32_t t,
                     transport::FilmPosition film, std::uint64_t key) {
    if (!reads_letters()) return sink_.light(found, s, t, film, key, nullptr, nullptr);
    const transport::ChannelLabels labels =
        t == 0 ? light_letters_->met_lens() : light_letters_->connected(*light_end_, towards_.wi);
    sink_.light(found, s, t, film, key, path_letters_, &labels);
  }

  transport::Towards* wanted_towards() { return kRecords || reads_letters() ? &towards_ : nullptr; }
  transport::WeightTerms* wanted_terms() { return kLists ? &terms_ : nullptr; }
  void weigh(transport::Contribution& found) const { found.weight = list_.weight(options_.heuristic); }

  const scene::Scene& scene_;
  const PathOptions& options_;
  const Techniques& techniques_;
  Sink& sink_;
  film::SampleCounts& sample_counts_;
  Choice choice_;
  transport::MisFactors factors_;
  transport::WalkRules eye_rules_, light_rules_;
  const transport::ConnectContext eye_context_{scene_, factors_, eye_rules_, sample_counts_};
  const transport::ConnectContext light_context_{scene_, factors_, light_rules_, sample_counts_};
  transport::Subpath<typename Mis::Block> light_, eye_;
  transport::WeightTerms terms_;
  transport::TechniqueList list_;
  // Only the next direction tells if light passes a vertex straight, so walks choose one at their last
  // vertex, too. In scenes where nothing passes they do not, though layers have the kernel for media: chains
  // would read numbers that they do not read without layers, and go another way.
  const bool passes_;
  [[no_unique_address]] EditedSubpaths<kEdits> edits_;
  const transport::PathLetters* const path_letters_;
  std::optional<transport::EyeLetters> eye_letters_;
  std::optional<transport::LightLetters> light_letters_;
  std::vector<transport::ChannelStates> light_states_;  // before the vertices of light_
  transport::Towards towards_;
  const Vertex* light_end_ = nullptr;  // of the light path's vertex that is connected to the lens
  [[no_unique_address]] std::conditional_t<kMollifies, MollifiedPaths, NoMollifiedPaths> mollified_{
      eye_context_};
};

// Light that meets the lens (t = 0), connections to the lens (t = 1).
template <class Config>
struct Bidirectional<Config>::LightSide {
  Bidirectional& e;
  const transport::ConnectContext& context;

  void started(const LightWalk& walk) {
    if constexpr (kRecords) e.sink_.light_started(walk.origin(), walk.sample_key());
    if constexpr (kEdits) e.edits_.begin_light(walk.origin().vertex.emitter);
    if (e.reads_letters()) e.light_letters_->begin(walk.origin(), walk.sample_key());
    if constexpr (kMollifies) e.mollified_.light_started(walk.origin());
  }
  void met_lens(const LightWalk& walk, std::uint64_t key) {
    const std::uint32_t s = walk.lens().edges + 1;
    if (walk.lens().edges < e.options_.min_edges || !e.choice_.wants(s, 0)) return;
    transport::FilmPosition film;
    transport::Contribution found =
        transport::hit_lens(context, walk, transport::ConstantEta{}, film, e.wanted_terms());
    if (!(found.weight > 0)) return;
    if constexpr (kEdits) found.value *= e.edits_.share_at_lens();
    if constexpr (kLists) {
      const Vertex& last = *e.light_.before();
      e.list_.clear();
      e.list_.add(e.terms_.next);
      e.list_.add_side(e.light_, last, e.terms_.light_step, last.pdf_reverse, last.left_by_delta);
      e.weigh(found);
    }
    if constexpr (kRecords) e.sink_.met_lens(e.light_, walk.direction(), film);
    e.to_light_sink(found, s, 0, film, rng::combine(key, 2));
  }
  bool vertex(const LightWalk& walk, std::conditional_t<kEdits, Vertex, const Vertex>& v, std::uint64_t key) {
    const std::uint32_t s = v.edges + 1;
    if constexpr (kEdits) e.edits_.light_vertex(e.light_.size(), v);
    if (e.reads_letters()) {
      e.light_states_.resize(e.light_.size());  // it is the next of the list, if it stays
      e.light_states_.push_back(e.light_letters_->states());
    }
    transport::FilmPosition film;
    transport::Contribution found;
    if (e.techniques_.light_image && v.connectible && s >= e.options_.min_edges && e.choice_.wants(s, 1) &&
        transport::connect_lens<kEdgeContent, Mis>(context, walk.draws(), v, transport::ConstantEta{}, film,
                                                   found, e.wanted_terms(), e.wanted_towards())) {
      if constexpr (kEdits) found.value *= e.edits_.light_share(e.light_.size(), v);
      if constexpr (kLists) {
        e.list_.clear();
        e.list_.add(e.terms_.next);
        e.list_.add_side(e.light_, v, e.terms_.light_step, e.terms_.light_reverse);
        e.weigh(found);
      }
      e.light_end_ = &v;
      if constexpr (kRecords) e.sink_.to_lens(e.light_, v, e.towards_.wi, film);
      e.to_light_sink(found, s, 1, film, rng::combine(key, 3));
    }
    if constexpr (kMollifies)
      e.mollified_.light_vertex(context, e.choice_, e.options_.min_edges, walk.draws(), v, key, e.sink_);
    return (LightWalk::kPasses && e.passes_) || e.choice_.light_goes_on(v.edges);
  }
  bool scattered(const LightWalk& walk, const Vertex& v) const {
    if (e.reads_letters()) e.light_letters_->scattered(v, walk.direction());
    if constexpr (kMollifies) e.mollified_.light_scattered(context, v);
    if constexpr (kEdits) e.edits_.leave_light(e.light_.size(), v);
    return e.choice_.light_goes_on(v.edges);
  }
};

// Light met (s = 0), next event estimation (s = 1), connections to the light path's vertices.
template <class Config>
struct Bidirectional<Config>::EyeSide : transport::EyeTechniques {
  Bidirectional& e;
  const transport::ConnectContext& context;

  void arrived(const EyeWalk& /*walk*/, const Vertex& v, const Vertex* before, bool left) {
    transport::Contribution found;
    if (!e.techniques_.hit_light || v.edges < e.options_.min_edges || !e.choice_.wants(0, v.edges + 1) ||
        !transport::hit_light<Mis>(context, v, left, before, {}, found, e.wanted_terms()))
      return;
    if constexpr (kEdits) found.value *= e.edits_.share_at_light(v, left);
    if constexpr (kLists) {
      if (v.edges > 1) {
        e.list_.clear();
        e.list_.add(e.terms_.next);
        e.list_.add_side(e.eye_, v, e.terms_.eye_step, e.terms_.eye_reverse, true);
        e.weigh(found);
      }
    }
    if constexpr (kRecords) e.sink_.met(e.eye_, v, left);
    e.sink_.eye(found, 0, v.edges + 1);
    if (e.reads_letters()) e.eye_letters_->met(e.sink_.sum(), v, left);
  }
  bool vertex(const EyeWalk& walk, std::conditional_t<kEdits, Vertex, const Vertex>& v) {
    if constexpr (kEdits) e.edits_.eye_vertex(e.eye_.size(), v);
    if (v.connectible && v.edges < e.eye_rules_.max_edges) {
      if (e.techniques_.next_event && v.edges + 1 >= e.options_.min_edges) light_directly(walk, v);
      if (e.techniques_.connect) connect_all(walk, v);
    }
    if constexpr (kMollifies)
      e.mollified_.eye_vertex(context, e.choice_, e.options_.min_edges, walk.draws(), v, e.sink_);
    return (EyeWalk::kPasses && e.passes_) || e.choice_.eye_goes_on(v.edges);
  }
  bool scattered(const EyeWalk& walk, const Vertex& v) const {
    if (e.reads_letters()) e.eye_letters_->scattered(v, walk.direction());
    if constexpr (kMollifies) e.mollified_.eye_scattered(context, v);
    if constexpr (kEdits) e.edits_.leave_eye(e.eye_.size(), v);
    return e.choice_.eye_goes_on(v.edges);
  }

 private:
  void light_directly(const EyeWalk& walk, const Vertex& v) {
    transport::Contribution found;
    if (!e.choice_.wants(1, v.edges + 1)) return;
    if constexpr (kEdits) {
      const auto next_event = [&] {
        return transport::next_event<kEdgeContent, Mis>(context, walk.draws(), v, {}, found, e.wanted_terms(),
                                                        &e.towards_);
      };
      if (!e.edits_.light_directly(e.eye_.size(), v, next_event, found, e.towards_)) return;
    } else if (!transport::next_event<kEdgeContent, Mis>(context, walk.draws(), v, {}, found,
                                                         e.wanted_terms(), e.wanted_towards())) {
      return;
    }
    if constexpr (kLists) {
      e.list_.clear();
      e.list_.add(e.terms_.next);
      e.list_.add_side(e.eye_, v, e.terms_.eye_step, e.terms_.eye_reverse);
      e.weigh(found);
    }
    if constexpr (kRecords) e.sink_.lit(e.eye_, v, walk.draws());
    e.sink_.eye(found, 1, v.edges + 1);
    if (e.reads_letters()) e.eye_letters_->lit(e.sink_.sum(), v, e.towards_);
  }
  void connect_all(const EyeWalk& walk, const Vertex& v) {
    const std::uint64_t passage = transport::passage_key<kEdgeContent>(context, walk.draws());
    transport::Contribution found;
    for (std::uint32_t i = 0; i < e.light_.size(); ++i) {
      const Vertex& z = e.light_[i];
      if (!z.connectible || z.edges + v.edges + 1 > e.eye_rules_.max_edges) continue;
      if (!e.choice_.wants(z.edges + 1, v.edges + 1)) continue;
      if constexpr (kEdits) e.edits_.join(i, z, e.eye_.size(), v);
      if (!transport::connect<kEdgeContent, Mis>(context, z, v, rng::combine(passage, i + 1), {}, found,
                                                 e.wanted_terms()))
        continue;
      if constexpr (kEdits) found.value *= e.edits_.light_share(i, z) * e.edits_.eye_share(e.eye_.size(), v);
      if constexpr (kLists) {
        e.list_.clear();
        e.list_.add_side(e.light_, z, e.terms_.light_step, e.terms_.light_reverse);
        e.list_.add_side(e.eye_, v, e.terms_.eye_step, e.terms_.eye_reverse);
        e.weigh(found);
      }
      if constexpr (kRecords) e.sink_.connected(e.eye_, v, e.light_, z);
      e.sink_.eye(found, z.edges + 1, v.edges + 1);
      if (e.reads_letters()) e.eye_letters_->connected(e.sink_.sum(), v, z, e.light_states_[i]);
    }
  }
};

}  // namespace candela::estimators
