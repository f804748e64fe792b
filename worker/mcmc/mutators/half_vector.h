// Mutations of all half vectors of a path, its ends held [half-vector note, sections 9 to 12; Kaplanyan 2017,
// ch. 8]: by one step, predicted and projected; or by a walk to the slopes that were drawn, which the path
// has to be found back from.
//
// The density of a walk is that of its slopes times |J|: in the measure of areas. A specular vertex has no
// density of a slope; its delta function is in half vectors, and contribution leaves it out in directions
// towards the light, so that |d omega / d c| of these is part of T.
#pragma once

#include <optional>
#include <string_view>

#include "worker/mcmc/mutators/mutator.h"
#include "worker/transport/manifold/proposal.h"
#include "worker/transport/path/segment.h"

namespace candela::mcmc {

struct HalfVectorRules {
  bool one_step = false;
  // Each gamma is a mutation of its own.
  transport::manifold::StepRules step;
};

class HalfVectorMutator final : public PathMutator {
 public:
  // The scene must outlive this.
  HalfVectorMutator(const scene::Scene& scene, const HalfVectorRules& rules) : scene_(scene), rules_(rules) {}

  std::string_view name() const override { return rules_.one_step ? "one_step" : "half_vector"; }
  double suitability(const PathState& from) const override;
  Proposal propose(const PathState& from, rng::Stream& stream) const override;
  std::optional<double> log_pdf_area(const PathState& from, const PathState& to) const override;

 private:
  // Nothing: the path is no chain of half vectors.
  struct SegmentMemo final : Memo {
    std::optional<transport::path::Segment> segment;
  };
  const std::optional<transport::path::Segment>& segment(const PathState& state) const;
  std::optional<transport::path::Segment> make_segment(const PathState& state) const;
  // Nothing: nor is it if the segment has no half vectors, or cannot be solved.
  struct Prepared {
    const transport::path::Segment* segment = nullptr;  // the state keeps it
    transport::manifold::PreparedChain chain;
  };
  struct PreparedMemo final : Memo {
    std::optional<Prepared> prepared;
  };
  const std::optional<Prepared>& prepared(const PathState& state) const;
  std::optional<Prepared> prepare_path(const PathState& state) const;

  const scene::Scene& scene_;
  HalfVectorRules rules_;
};

}  // namespace candela::mcmc
