// Manifold exploration [Jakob 2012, Sec. 5; half-vector note, section 14].
//
// Let a, b, c be three vertices of the path, with only specular vertices between them; a and c stay. The
// direction at a is turned, and a ray from there makes a new path up to b. The specular vertices between
// b and c walk to points that obey the laws of reflection and refraction, and must walk back from there to
// their old points; otherwise the mutation fails.
//
//   T = P(a, b, c | X) p(direction at a) prod (cosine / length^2 from a to b) |J| prod |d omega / d c_i|
//
// J and the derivatives, of the direction towards the light by the slope, are those of the chain from b to c
// in Y: its vertices have delta functions of slopes, where f has those of directions.
//
// a is the neighbor on whose side fewer specular vertices are, of two the one towards the sensor. If it is
// the sensor, the film position moves instead of a direction. Steps are normally distributed on the film, and
// of the von Mises-Fisher distribution around a direction; each is at one of three scales, chosen by chance.
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>
#include <vector>

#include "worker/mcmc/mutators/context.h"
#include "worker/mcmc/mutators/mutator.h"
#include "worker/mcmc/mutators/tracing.h"
#include "worker/transport/path/segment.h"

namespace candela::mcmc {

class ManifoldMutator final : public PathMutator {
 public:
  // step: standard deviation on the film, in pixels, at the largest scale.
  ManifoldMutator(const MutatorContext& context, double step) : context_(context), step_(step) {}

  std::string_view name() const override { return "manifold"; }
  double suitability(const PathState& from) const override;
  Proposal propose(const PathState& from, rng::Stream& stream) const override;
  std::optional<double> log_pdf_area(const PathState& from, const PathState& to) const override;
  double squared_move(const PathState& from, const PathState& to) const override;

  struct Choice {
    std::size_t a = 0, b = 0, c = 0;  // a > b > c: the ray comes from the sensor's side
    bool from_sensor() const { return a > b; }
    bool walks() const { return from_sensor() ? b > c + 1 : c > b + 1; }
    std::size_t specular_count() const { return (from_sensor() ? a - c : c - a) - 2; }
  };

 private:
  struct Choices;
  const std::vector<Choice>& choices_of(const PathState& from) const;
  double angle_scale(const PathState& from, const Choice& choice) const;
  bool trace(const PathState& from, const Choice& choice, rng::Stream& stream,
             transport::path::Path& path) const;
  std::optional<double> log_pdf_walk(const PathState& to, const Choice& choice) const;

  const MutatorContext context_;
  double step_;
};

}  // namespace candela::mcmc
