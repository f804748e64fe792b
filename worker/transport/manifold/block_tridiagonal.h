// The Jacobian J = d(constraints) / d(inner vertices) of a chain in factors J = L U [half-vector note,
// section 6].
#pragma once

#include <span>
#include <vector>

#include "worker/transport/manifold/constraint.h"

namespace candela::transport::manifold {

class BlockTridiagonal {
 public:
  // False: a block of U is singular, although J need not be; a walk or a proposal that needs J fails then.
  // The test is the same in both directions of a mutation, as it depends on the chain alone.
  bool factor(std::span<const Blocks> blocks);

  std::size_t size() const { return inverse_u_.size(); }
  double det() const { return det_; }
  double log_abs_det() const { return log_abs_det_; }
  // Solves J x = r.
  std::vector<Pair> solve(std::span<const Pair> r) const;
  // T_i = dx_i / dx_k, all constraints fixed: by inner vertex.
  std::vector<Mat2> by_last_end() const;
  // D_i = dx_{k-1} / dc_i: the last row of blocks of the inverse.
  std::vector<Mat2> last_vertex_by_constraints() const;

 private:
  std::vector<Mat2> lower_, inverse_u_, upper_;  // upper: blocks c
  double det_ = 1, log_abs_det_ = 0;
};

// J x.
std::vector<Pair> multiply(std::span<const Blocks> blocks, std::span<const Pair> x);

}  // namespace candela::transport::manifold
