// All techniques that could have made a path, with their densities relative to the one that did: what
// heuristics need that look at more than the sum. Made by a walk along both subpaths' stored vertices, in
// time proportional to the path's length; mis/balance_power.h does it in constant time where the sum is
// enough.
#pragma once

#include <vector>

#include "worker/transport/mis/balance_power.h"
#include "worker/transport/rules.h"
#include "worker/transport/subpath.h"

namespace candela::transport {

// Densities, times samples, relative to that of the technique at hand, which is not in the list. The blocks
// of both subpaths must have been made with Balance and without merging.
class TechniqueList {
 public:
  // The techniques that connect at v or before it, v the last vertex of its subpath. `step`: v's density as
  // the other side's walk makes it, relative to the technique at hand; `reverse`: v's pdf_reverse. skip_last
  // leaves out the connection that ends at v.
  // chain[i]: vertex i of v's subpath.
  template <class Chain>
  void add_side(const Chain& chain, const Vertex<MisBlock>& v, double step, double reverse,
                bool skip_last = false) {
    double relative = step;
    for (const Vertex<MisBlock>* at = &v;;) {
      if (!skip_last) add(relative * at->mis.known);
      if (at->edges == 1) {
        add(relative * reverse * at->mis.pending);
        return;
      }
      relative *= reverse * at->back_area / at->pdf_area;
      at = &chain[at->parent];
      reverse = at->pdf_reverse;
      skip_last = at->left_by_delta;
    }
  }
  void add(double relative) {
    if (relative > 0) others_.push_back(relative);
  }
  void clear() { others_.clear(); }

  // The weight of the technique at hand. Powers: [Veach 1997, Eq. 9.13]; cutoff: what lies below kCutoff of
  // the largest is left out [Veach 1997, Eq. 9.11]; maximum: the largest alone [Veach 1997, Eq. 9.14]. What
  // is within rounding of the largest shares with it, so that techniques of equal density leave nothing out.
  double weight(MisHeuristic heuristic) const;

  static constexpr double kCutoff = 0.1;
  static constexpr double kTie = 1e-4;

 private:
  std::vector<double> others_;
};

}  // namespace candela::transport
