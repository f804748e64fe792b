// The perturbations that begin at the sensor [Veach 1997, Sec. 11.4.3.1 and 11.4.3.3; half-vector note,
// section 14]: the film position moves by a distance with a uniform logarithm, and a ray through it makes the
// path anew up to a vertex x_j, which is connected to the next one, or is on a light.
//
//   lens        the ray passes specular vertices up to the first one that is not: x_j
//   multichain  at a vertex that is not specular, and whose neighbor towards the light is, the direction of
//               the path that it comes from is turned by an angle with a uniform logarithm: a new chain begins
//
// The point on the lens stays. T = p(film position) times that of the angles, times what tracing.h says.
#pragma once

#include <optional>
#include <string_view>

#include "worker/mcmc/mutators/mutator.h"
#include "worker/mcmc/mutators/tracing.h"

namespace candela::mcmc {

struct LensRules {
  bool multichain = false;
  double film_width = 1, film_height = 1;  // in pixels
  float film_border = 0;
  LogStep film;                     // in pixels
  LogStep angle{0.0001, 0.01};      // in radians, of chains behind the first
  // Steps up to a disk of this share of the film [Veach 1997, Sec. 11.4.3.1].
  static LensRules of_film(bool multichain, double width, double height, float border);
};

class LensMutator final : public PathMutator {
 public:
  // The scene must outlive this.
  LensMutator(const scene::Scene& scene, const LensRules& rules) : scene_(scene), rules_(rules) {}

  std::string_view name() const override { return rules_.multichain ? "multichain" : "lens"; }
  double suitability(const PathState& from) const override;
  Proposal propose(const PathState& from, rng::Stream& stream) const override;
  std::optional<double> log_pdf_area(const PathState& from, const PathState& to) const override;

 private:
  const scene::Scene& scene_;
  LensRules rules_;
};

}  // namespace candela::mcmc
