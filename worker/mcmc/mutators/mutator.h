// Mutations of paths [Veach 1997, ch. 11]. A mutation is one file pair.
//
// The chain accepts `to` with the probability
//   min(1, f(to) pi(to) T(to -> from) / (f(from) pi(from) T(from -> to)))
// where pi is the probability of choosing the mutation at a path, and T its density in the measure of
// PathState::contribution. T is a function of the two paths alone, and is computed anew for both directions.
#pragma once

#include <optional>
#include <string_view>

#include "common/rng/stream.h"
#include "worker/core/math.h"
#include "worker/mcmc/mutators/path_state.h"

namespace candela::mcmc {

class PathMutator {
 public:
  virtual ~PathMutator() = default;
  virtual std::string_view name() const = 0;

  // The weight of its choice at the path, 0: it cannot change such a path.
  virtual double suitability(const PathState& from) const = 0;
  // Nothing: the mutation fails, which counts as a rejection. Random numbers are from the stream alone.
  // Precondition: suitability(from) > 0.
  virtual std::optional<transport::path::Path> propose(const PathState& from, rng::Stream& stream) const = 0;
  // log T(from -> to). Nothing: it never proposes `to`.
  virtual std::optional<double> log_pdf_area(const PathState& from, const PathState& to) const = 0;
};

// log of f(to) T(to -> from) / (f(from) T(from -> to)). Nothing: one of the densities is zero.
inline std::optional<double> log_acceptance(const PathMutator& mutator, const PathState& from,
                                            const PathState& to) {
  const auto forward = mutator.log_pdf_area(from, to), back = mutator.log_pdf_area(to, from);
  if (!forward || !back) return std::nullopt;
  return math::log(to.scalar) - math::log(from.scalar) + *back - *forward;
}

}  // namespace candela::mcmc
