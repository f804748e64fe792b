// Light paths as functions of their primary samples, and the photons that they leave near gather places.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "worker/estimators/light_store.h"
#include "worker/integrators/mcppm/gather_places.h"
#include "worker/mcmc/primary_state.h"
#include "worker/transport/letters/layer_sums.h"
#include "worker/transport/light_path.h"

namespace candela::integrators::mcppm {

using Block = transport::Unweighted::Block;
using PhotonStore = estimators::LightStore<Block>;

// The light paths of a thread: an mcmc::IndicatorTarget over the visible ones. Photons of states are at the
// end of the store: first those of the present state, then those of the proposal. A deposit leaves them there
// for good. Only photons near gather places are kept.
template <transport::EdgeContent kEdgeContent>
class LightPaths {
 public:
  using LightWalk = transport::Walk<transport::TransportMode::importance, kEdgeContent, transport::Unweighted,
                                    mcmc::PrimarySampler>;
  using Vertex = typename LightWalk::Vertex;

  // All by reference but the counts: they outlive the paths.
  LightPaths(const UnitContext& context, const merging::IterationOptions& options,
             const estimators::PathCounts& counts, const GatherPlaces& places, PhotonStore& store,
             film::SampleCounts& sample_counts)
      : scene_(context.scene),
        rules_(estimators::light_rules(options.paths, options.techniques, counts)),
        places_(places),
        store_(store),
        sample_counts_(sample_counts) {
    if (transport::reads_letters<kEdgeContent>(context.letters)) letters_.emplace(*context.letters);
  }

  // True if the path of these numbers is visible. Leaves nothing.
  bool visible(mcmc::PrimaryState& numbers) {
    const Mark before = mark();
    first_alone_ = true;
    const bool any = trace(numbers, before);
    first_alone_ = false;
    drop_from(before);
    return any;
  }

  // The target: see short_chain.h.
  void start(mcmc::PrimaryState& numbers) {
    present_ = mark();
    trace(numbers, present_);
    proposal_ = mark();
  }
  bool propose(mcmc::PrimaryState& numbers) {
    ++sample_counts_.light_paths;
    return trace(numbers, proposal_);
  }
  void accept() {
    present_ = proposal_;
    proposal_ = mark();
  }
  void reject() { drop_from(proposal_); }
  void deposit(double weight) {
    const auto factor = static_cast<float>(weight);
    store_.surface.scale_flux(present_.surface, proposal_.surface, factor);
    store_.medium.scale_flux(present_.medium, proposal_.medium, factor);
  }

  // The techniques: see transport/light_path.h.
  void started(const LightWalk& walk) {
    if (letters_) letters_->begin(walk.origin(), walk.sample_key());
  }
  static void met_lens(const LightWalk& /*walk*/, std::uint64_t /*key*/) {}
  bool vertex(const LightWalk& /*walk*/, const Vertex& v, std::uint64_t /*key*/) {
    if (!v.connectible || !places_.see(v)) return true;
    store_.keep(scene_, v, false, by_specular_, sample_counts_, letters_ ? &letters_->states() : nullptr);
    return !first_alone_ || mark() == begin_;
  }
  bool scattered(const LightWalk& walk, const Vertex& v) {
    by_specular_ = v.left_by_delta;
    if (letters_) letters_->scattered(v, walk.direction());
    return true;
  }

 private:
  // Numbers of photons.
  struct Mark {
    std::size_t surface = 0, medium = 0;
    bool operator==(const Mark&) const = default;
  };
  Mark mark() const { return {store_.surface.size(), store_.medium.size()}; }
  void drop_from(const Mark& mark) {
    store_.surface.drop_from(mark.surface);
    store_.medium.drop_from(mark.medium);
  }
  // Appends photons to the store. True: there are any.
  bool trace(mcmc::PrimaryState& numbers, const Mark& begin) {
    begin_ = begin;
    by_specular_ = false;
    LightWalk walk(scene_, rules_, factors_, numbers.walk(mcmc::PrimaryState::light), sample_counts_);
    transport::follow_light_path(walk, room_, *this);
    return mark() != begin;
  }

  const scene::Scene& scene_;
  const transport::MisFactors factors_;
  const transport::WalkRules rules_;
  const GatherPlaces& places_;
  PhotonStore& store_;
  film::SampleCounts& sample_counts_;
  transport::VertexPair<Block> room_;
  std::optional<transport::LightLetters> letters_;
  Mark present_, proposal_, begin_;  // begin_: of the path under way
  bool by_specular_ = false, first_alone_ = false;
};

}  // namespace candela::integrators::mcppm
