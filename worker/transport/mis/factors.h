// Numbers of samples of each technique: all that weights (mis/balance_power.h) know of an integrator.
#pragma once

#include <concepts>

#include "worker/transport/film_position.h"

namespace candela::transport {

// Merges in media, each the number of light paths times its effective volume, area or length, 0: not run.
// The first word is the light's entity, the second the eye's; beams are short.
struct MediumMerges {
  double point_point = 0, point_beam = 0, beam_point = 0, beam_beam = 0;

  // The sum at a vertex where light turns by an angle of this sine. Hazards: where the light's subpath has
  // the vertex, and where the eye's has it; one and the same but in a merge. [Krivanek 2014]
  double at(double light_hazard, double eye_hazard, double sine) const {
    const double light = 1 / light_hazard, eye = 1 / eye_hazard;
    return point_point +
           eye * (point_beam + eye_hazard / light_hazard * beam_point + light * sine * beam_beam);
  }
};

// Samples per eye path, 0: not run. Raised as the heuristic wants it.
struct MisFactors {
  double hit_light = 1, next_event = 1, connect = 1;
  double light_image = 1, hit_lens = 1;  // the number of light paths per iteration
  // By the number of the medium; null: none. Read by BeamBalance (mis/beam_balance.h) alone.
  const MediumMerges* medium = nullptr;
  // The share of pairs of two vertices in media that are connected; above 0. Read by BeamBalance alone.
  double connect_media = 1;
};

// eta, raised; 0: no merging.
struct MergeFactors {
  double surface = 0, medium = 0;
};

// eta as a function of the place on the film that a path arrives at. It must not depend on the technique that
// made the path: a splat from a light path and the eye path through the same place see the same eta, so that
// the weights of a path sum to one. Nothing that a vertex stores contains eta.
template <class T>
concept EtaField = requires(const T& field, FilmPosition at) {
  { field.at(at) } -> std::convertible_to<MergeFactors>;
};

// The same eta everywhere.
struct ConstantEta {
  MergeFactors factors;
  const MergeFactors& at(FilmPosition /*place*/) const { return factors; }
};

}  // namespace candela::transport
