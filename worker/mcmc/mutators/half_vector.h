// Mutations of the half vectors of a path, or of a segment of it, its ends held [half-vector note, sections 9
// to 13; Kaplanyan 2017, ch. 8]: by one step, predicted and projected; or by a walk to the slopes that were
// drawn, which the path has to be found back from.
//
// The density of a walk is that of its slopes times |J|: in the measure of areas. A specular vertex has no
// density of a slope; its delta function is in half vectors, and contribution leaves it out in directions
// towards the light, so that |d omega / d c| of these is part of T.
//
// Segments [half-vector note, section 13; Hanika 2015]: the path is broken at its ends, at diffuse vertices,
// and at vertices that have no half vectors, as their normal is turned by a map. One of the segments that
// have vertices in between is chosen, each as probable as the others. Other mutations move the vertices where
// the path is broken.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "worker/mcmc/mutators/mutator.h"
#include "worker/transport/manifold/proposal.h"
#include "worker/transport/path/segment.h"

namespace candela::mcmc {

struct HalfVectorRules {
  bool one_step = false;
  // Each gamma is a mutation of its own.
  transport::manifold::StepRules step;
  bool segments = false;  // false: the whole path is the segment
};

class HalfVectorMutator final : public PathMutator {
 public:
  // All must outlive this. rays: counts them; null: nobody does.
  HalfVectorMutator(const scene::Scene& scene, const HalfVectorRules& rules, std::uint64_t* rays = nullptr)
      : scene_(scene), rules_(rules), rays_(rays) {}

  std::string_view name() const override { return rules_.one_step ? "one_step" : "half_vector"; }
  double suitability(const PathState& from) const override;
  Proposal propose(const PathState& from, rng::Stream& stream) const override;
  std::optional<double> log_pdf_area(const PathState& from, const PathState& to) const override;

 private:
  // A segment of a state, and what is prepared of it when it is first asked for. Nothing: it has no half
  // vectors, or its Jacobian has no inverse.
  struct Stretch {
    transport::path::Segment segment;
    mutable bool is_prepared = false;
    mutable std::optional<transport::manifold::PreparedChain> chain;
  };
  struct Stretches final : Memo {
    std::vector<Stretch> all;
  };
  const std::vector<Stretch>& stretches(const PathState& state) const;
  void add_stretch(const PathState& state, std::size_t begin, std::size_t end,
                   std::vector<Stretch>& out) const;
  const std::optional<transport::manifold::PreparedChain>& prepared(const PathState& state,
                                                                    const Stretch& stretch) const;
  std::optional<transport::manifold::PreparedChain> prepare_stretch(
      const PathState& state, const transport::path::Segment& segment) const;

  const scene::Scene& scene_;
  HalfVectorRules rules_;
  std::uint64_t* rays_;
};

}  // namespace candela::mcmc
