// Numbers of samples of each technique: all that weights (mis/balance_power.h) know of an integrator.
#pragma once

#include <algorithm>
#include <concepts>

#include "worker/transport/film_position.h"

namespace candela::transport {

// Merges in media, each the number of light paths times its effective volume, area or length, 0: not run.
// The first word is the light's entity, the second the eye's.
struct MediumMerges {
  double point_point = 0, point_beam = 0, beam_point = 0, beam_beam = 0;
  // True: light's and the eye's beams go on behind the end of their flight. A long beam does not choose
  // whether it gets to a place either, so that its merges divide by the survival of its edge, too.
  bool long_photon_beams = false, long_query_beams = false;

  // The least survival that counts. Smaller ones would let the quotients overflow.
  static constexpr double kMinSurvival = 1e-30;
  double light_survival(double edge) const { return long_photon_beams ? std::max(edge, kMinSurvival) : 1; }
  double eye_survival(double edge) const { return long_query_beams ? std::max(edge, kMinSurvival) : 1; }

  // The sum at a vertex where light turns by an angle of this sine. Hazards: where the light's subpath has
  // the vertex, and where the eye's has it; one and the same but in a merge. Survivals: of the edge by which
  // the light's subpath arrives at the vertex, and the eye's. [Krivanek 2014]
  double at(double light_hazard, double eye_hazard, double sine, double light_edge, double eye_edge) const {
    const double light = 1 / light_hazard, eye = 1 / eye_hazard;
    if (!long_photon_beams && !long_query_beams)
      return point_point +
             eye * (point_beam + eye_hazard / light_hazard * beam_point + light * sine * beam_beam);
    const double of_light = light / light_survival(light_edge), of_eye = eye / eye_survival(eye_edge);
    return point_point + of_eye * point_beam + of_light * beam_point + of_light * of_eye * sine * beam_beam;
  }

  // The same sum at a vertex that a walk leaves, in two parts: `beams` is to be divided by the survival of
  // the edge that the walk leaves by, which it knows when it arrives at the next vertex. survival: of the
  // edge that it arrived by.
  struct Leaving {
    double known = 0, beams = 0;
  };
  Leaving leaving(bool from_light, double hazard, double sine, double survival) const {
    const bool next_is_long = from_light ? long_query_beams : long_photon_beams;
    if (!next_is_long) return {at(hazard, hazard, sine, survival, survival), 0};
    const double own = from_light ? light_survival(survival) : eye_survival(survival);
    const double of_own = (from_light ? beam_point : point_beam) / (hazard * own);
    const double of_next =
        ((from_light ? point_beam : beam_point) + sine * beam_beam / (hazard * own)) / hazard;
    return {point_point + of_own, of_next};
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
