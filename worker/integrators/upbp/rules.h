// The rules that a job of upbp runs by.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "worker/integrators/planned.h"

namespace candela::integrators::upbp {

// Merges in media: whether they are run, and the first radius of each as a fraction of the scene's, 0: that
// of surfaces.
struct MediumRules {
  bool pp3d = false, pb2d = false, bp2d = false, bb1d = false;
  double radius_pp3d = 0, radius_pb2d = 0, radius_bp2d = 0, radius_bb1d = 0;
  std::uint64_t beam_paths = 0;  // at most so many leave beams; 0: all
  double free_paths = 0;         // radii have at most so many mean free paths; 0: any
  double connect_media = 1;      // share of pairs of vertices in media that are connected
  bool merge_surfaces = true;
  // In homogeneous media: whether beams go on behind the end of their flight.
  bool long_photon_beams = false, long_query_beams = false;

  bool any() const { return pp3d || pb2d || bp2d || bb1d; }
  bool points() const { return pp3d || pb2d; }
  bool beams() const { return bp2d || bb1d; }
  bool operator==(const MediumRules&) const = default;
};

struct Rules {
  std::string name;  // as the setting `techniques` has it, for people
  Planned planned;
  MediumRules medium;
  bool only_if_cheap = false;  // tried only if the set before it costs at most kCheap times the first
  // Index of the set that this one refines by fewer connections in media, long query beams, or both. Tried
  // only if that set wins.
  std::optional<std::size_t> refined = {};
};

}  // namespace candela::integrators::upbp
