// The caustic perturbation [Veach 1997, Sec. 11.4.3.2; half-vector note, section 14]: at a vertex x_l that is
// not specular, or on the light, the direction towards the sensor is turned by an angle with a uniform
// logarithm. A ray along it passes the specular vertices behind x_l as the path does, up to a vertex that is
// not specular, and is connected to the sensor.
//
// The range of angles is that in which the film position moves by the range of the lens perturbation's
// steps, if nothing but distances counts: it follows from the path that the mutation comes from, so that the
// densities of the two directions differ.
#pragma once

#include <optional>
#include <string_view>

#include "worker/mcmc/mutators/context.h"
#include "worker/mcmc/mutators/mutator.h"
#include "worker/mcmc/mutators/tracing.h"

namespace candela::mcmc {

class CausticMutator final : public PathMutator {
 public:
  // film: of the lens perturbation.
  CausticMutator(const MutatorContext& context, LogStep film) : context_(context), film_(film) {}

  std::string_view name() const override { return "caustic"; }
  double suitability(const PathState& from) const override;
  Proposal propose(const PathState& from, rng::Stream& stream) const override;
  std::optional<double> log_pdf_area(const PathState& from, const PathState& to) const override;
  double squared_move(const PathState& from, const PathState& to) const override {
    return film_move(context_, from, to);
  }

 private:
  LogStep angles(const PathState& from, std::size_t begin) const;

  const MutatorContext context_;
  LogStep film_;
};

}  // namespace candela::mcmc
