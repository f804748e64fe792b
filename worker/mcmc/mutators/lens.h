// The perturbations that begin at the sensor [Veach 1997, Sec. 11.4.3.1 and 11.4.3.3; half-vector note,
// section 14]: the film position moves by a distance with a uniform logarithm, and a ray through it makes the
// path anew up to a vertex x_j, which is connected to the next one, or is on a light.
//
//   lens        the ray passes specular vertices up to the first one that is not: x_j
//   multichain  at a vertex that is not specular, and whose neighbor towards the light is, the direction of
//               the path that it comes from is turned by an angle with a uniform logarithm: a new chain
//               begins
//
// The point on the lens stays. T = p(film position) times that of the angles, times what tracing.h says.
#pragma once

#include <optional>
#include <string_view>

#include "worker/mcmc/mutators/context.h"
#include "worker/mcmc/mutators/mutator.h"
#include "worker/mcmc/mutators/tracing.h"

namespace candela::mcmc {

struct LensRules {
  bool multichain = false;
  LogStep film;                 // in pixels
  LogStep angle{0.0001, 0.01};  // in radians, of chains behind the first
};

class LensMutator final : public PathMutator {
 public:
  LensMutator(const MutatorContext& context, const LensRules& rules) : context_(context), rules_(rules) {}

  std::string_view name() const override { return rules_.multichain ? "multichain" : "lens"; }
  double suitability(const PathState& from) const override;
  Proposal propose(const PathState& from, rng::Stream& stream) const override;
  std::optional<double> log_pdf_area(const PathState& from, const PathState& to) const override;
  double squared_move(const PathState& from, const PathState& to) const override {
    return film_move(context_, from, to);
  }

 private:
  const MutatorContext context_;
  LensRules rules_;
};

}  // namespace candela::mcmc
