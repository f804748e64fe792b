// The bidirectional mutation [Veach 1997, Sec. 11.4.2]: the vertices between x_l and x_m are taken away, and
// others are put there by walks from both sides and an edge (subpaths.h). It alone changes the length and the
// kinds of a path.
//
// d vertices are taken away with a weight of p_d(d), among all ranges whose ends turn by no delta lobe; ends
// of the path may be among them, d is at most 16. a vertices come in with the weight p_a(a - d), among
// numbers that give a path of the chain's lengths. Since several ranges may make the same path, the density
// is the sum over all of them, in both directions. Ranges that would have to make a vertex again as it was
// are none of them, since that has no probability: but an end of which there is one, such as a pinhole.
#pragma once

#include <optional>
#include <string_view>

#include "worker/mcmc/mutators/context.h"
#include "worker/mcmc/mutators/mutator.h"
#include "worker/mcmc/mutators/subpaths.h"

namespace candela::mcmc {

class BidirectionalMutator final : public PathMutator {
 public:
  explicit BidirectionalMutator(const MutatorContext& context) : context_(context), subpaths_(context) {}

  std::string_view name() const override { return "bidirectional"; }
  double suitability(const PathState& from) const override;
  Proposal propose(const PathState& from, rng::Stream& stream) const override;
  std::optional<double> log_pdf_area(const PathState& from, const PathState& to) const override;

 private:
  struct Range {
    Subpaths::Kept kept;
    double weight = 0;
  };
  struct Ranges;
  const Ranges& ranges(const PathState& from) const;
  template <class Visit>
  bool any_range(const transport::path::Path& path, const Visit& visit) const;
  bool is_range(const transport::path::Path& path, const Subpaths::Kept& kept) const;
  struct Bounds {
    std::size_t begin = 0, end = 0;
  };
  Bounds bounds(const Subpaths::Kept& kept, std::size_t deleted) const;
  // True if `a` vertices, within the bounds, may take the place of `deleted` ones; and if there is such a
  // number.
  bool can_add(const Subpaths::Kept& kept, std::size_t deleted, std::size_t a) const;
  bool any_addition(const Subpaths::Kept& kept, std::size_t deleted) const;
  // Calls visit(a, weight) for each number of vertices that may take the place of `deleted` ones.
  template <class Visit>
  void for_each_addition(const Subpaths::Kept& kept, std::size_t deleted, const Visit& visit) const;

  const MutatorContext context_;
  Subpaths subpaths_;
};

}  // namespace candela::mcmc
