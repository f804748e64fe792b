// Mutations of paths [Veach 1997, ch. 11]. A mutation is one file pair, and a line of registry.cpp.
//
// The chain accepts `to` with the probability
//   min(1, f(to) pi(to) T(to -> from) / (f(from) pi(from) T(from -> to)))
// where pi is the probability of choosing the mutation at a path, and T its density in the measure of
// PathState::contribution. mcmc/path_space.cpp does this; a mutator only knows two paths:
//
// suitability(X): the weight of the mutation's choice at X. The space multiplies it by the mutation's share
// among the job's settings, and divides by the sum over all mutations. It is a function of X alone, at most
// 1, and 0 where propose() cannot succeed for a reason that X shows. It should cost little.
//
// propose(X): a path, or why there is none, which counts as a rejection. All randomness is the stream's. The
// path is well-formed; its points are canonical ones of the scene; the flags `delta` and `transmitted` are
// set as the path turns. The sensor vertex of a pinhole has the place {0.5, 0.5, 0}. Whether edges are free,
// and whether the path is on the film, is the space's question.
//
// log_pdf_area(X, Y): log T(X -> Y), anew from the two paths: the density of all ways in which propose(X)
// makes Y, or of one way if the choice of ways is a function of (X, Y) that is the same in both directions.
// Delta functions of specular vertices are left out as f leaves them out: they are per solid angle towards
// the light (path/evaluation.h). Ways that would have to make a vertex of X again by chance do not count
// beside those that keep it: but a point or directed light, and a sensor without a lens, are the same whoever
// makes them. Nothing: X never proposes Y.
//
// A mutator keeps what it computes of a state for several of these calls, as PathState::memo(this, ...).
// A mutator is immutable but for the scene's own caches; each chain and thread has its own.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <utility>

#include "common/rng/stream.h"
#include "worker/mcmc/mutators/path_state.h"

namespace candela::mcmc {

// Why a mutation comes to nothing, in the order in which it is found out.
enum class MutationFailure : std::uint8_t {
  none,
  no_path,         // a ray misses, is absorbed, or meets what the mutation does not allow
  no_convergence,  // a walk does not come to its target
  no_return,       // a walk does not come back from there
  dark,            // the path is there, but carries no light: an edge is blocked, or it leaves the film
  one_way,         // the mutation back does not exist
  not_finite,      // a density or contribution cannot be held
};
inline constexpr std::size_t kMutationFailures = 7;

// A path, or why there is none.
class Proposal {
 public:
  Proposal(transport::path::Path path) : path_(std::move(path)) {}  // NOLINT(google-explicit-constructor)
  Proposal(MutationFailure failure) : failure_(failure) {}          // NOLINT(google-explicit-constructor)
  Proposal(std::nullopt_t) : failure_(MutationFailure::no_path) {}  // NOLINT(google-explicit-constructor)
  explicit operator bool() const { return failure_ == MutationFailure::none; }
  const transport::path::Path& operator*() const { return path_; }
  transport::path::Path& operator*() { return path_; }
  const transport::path::Path* operator->() const { return &path_; }
  MutationFailure failure() const { return failure_; }

 private:
  transport::path::Path path_;
  MutationFailure failure_ = MutationFailure::none;
};

class PathMutator {
 public:
  virtual ~PathMutator() = default;
  virtual std::string_view name() const = 0;
  virtual double suitability(const PathState& from) const = 0;
  // Precondition: suitability(from) > 0.
  virtual Proposal propose(const PathState& from, rng::Stream& stream) const = 0;
  virtual std::optional<double> log_pdf_area(const PathState& from, const PathState& to) const = 0;
};

}  // namespace candela::mcmc
