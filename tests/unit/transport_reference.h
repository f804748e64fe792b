// The oracle of weights: every technique that can make a path, with its density, multiplied out from the
// literal formulas (path/evaluation.h). It is apart from the recursions of mis/, walk.h and technique/, which
// are tested against it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "worker/transport/path/evaluation.h"

namespace candela::transport::reference {

using path::Evaluation;
using path::FullPath;
using path::InnerVertex;
using path::PathNumbers;
using path::Rules;
using path::Scaled;
using path::Technique;

// Samples per eye path of each technique, not raised to any power; 0: not run.
struct Counts {
  double hit_light = 1, next_event = 1, connect = 1, light_image = 1, hit_lens = 1;
  double connect_media = 1;                    // share of the connections of two vertices in media
  double merge_surface = 0, merge_medium = 0;  // eta
  // The same of beams: number of light paths times the effective area or length. First the light's entity,
  // then the eye's.
  double point_beam = 0, beam_point = 0, beam_beam = 0;
  // True: light's and the eye's beams in the medium of this number are long; beyond: they are short.
  std::vector<bool> long_photon_beams = {}, long_query_beams = {};
  static bool in(const std::vector<bool>& media, std::uint32_t medium) {
    return medium < media.size() && media[medium];
  }
  // Radii of merges in a medium, over those of the eta above, by the number of the medium; beyond: 1.
  std::vector<double> radius_ratios = {};
  double radius_ratio(std::uint32_t medium) const {
    return medium < radius_ratios.size() ? radius_ratios[medium] : 1;
  }
};

// Every technique that can make the path, with its density: nothing but products.
std::vector<Technique> list_techniques(const PathNumbers& numbers, const Counts& counts);

enum class Heuristic : std::uint8_t { balance, power, maximum, cutoff };
// Weights in the order of the list. Power: beta = 2; cutoff: alpha below which a density relative to the
// largest counts as none [Veach 1997, Sec. 9.2.3]. Maximum: the first of equals has it all.
std::vector<double> weigh(const std::vector<Technique>& techniques, Heuristic heuristic, double alpha = 0.1);

}  // namespace candela::transport::reference
