// Options of estimators: limits that the user sets, techniques that a plan chose.
#pragma once

#include <array>
#include <cstdint>

#include "worker/transport/mis/factors.h"
#include "worker/transport/rules.h"

namespace candela::estimators {

inline constexpr std::uint32_t kNoDepthLimit = 1u << 30;

struct PathOptions {
  // Edges of the longest path, and from how many on Russian roulette may end a subpath.
  std::uint32_t max_depth = kNoDepthLimit, rr_depth = 2;
  // Paths with fewer edges do not count. At most 3; 2 leaves out emitters seen by the camera.
  std::uint32_t min_edges = 1;
  transport::MisHeuristic heuristic = transport::MisHeuristic::balance;
};

// The techniques of transport/mis/balance_power.h. An estimator looks at those that it knows.
struct Techniques {
  bool light_paths = true, eye_paths = true;
  bool hit_light = true, next_event = true, connect = true, light_image = true, hit_lens = true;
  bool merge_surface = true, merge_medium = true;

  static constexpr Techniques none() {
    return {false, false, false, false, false, false, false, false, false};
  }
  constexpr bool merges() const { return merge_surface || merge_medium; }
  // Merges bring all light that no eye path meets.
  constexpr bool photons_alone() const { return merges() && !connect && !next_event; }
  constexpr bool needs_light_paths() const { return connect || light_image || hit_lens || merges(); }
};

// Layers of the film with the shares of VcmEye (merging_eye.h) that merges in media; the connections are
// those to the lens, too.
inline constexpr std::array kTechniqueLayers = {"connections", "merging", "pp3d", "pb2d", "bp2d", "bb1d"};

// Numbers of paths that are weighted against each other; places on the film are uniform.
struct PathCounts {
  // Over the film: the density of eye paths is width * height times that of one pixel's.
  double eye_paths = 1;
  double light_paths = 1;
  float film_border = 0;  // pixels around the film that eye paths come from, or that splats matter in
  const transport::MediumMerges* medium = nullptr;  // as MisFactors has it
  double connect_media = 1;                         // likewise
};

template <class Mis>
transport::MisFactors mis_factors(const Techniques& t, const PathCounts& counts) {
  const auto one = [](bool runs) { return runs ? 1.0 : 0.0; };
  const double n = Mis::raise(counts.light_paths);
  return {one(t.hit_light),    one(t.next_event), one(t.connect),      n * one(t.light_image),
          n * one(t.hit_lens), counts.medium,     counts.connect_media};
}

inline transport::WalkRules eye_rules(const PathOptions& options, const Techniques& t,
                                      const PathCounts& counts) {
  return {options.max_depth, options.rr_depth, t.hit_lens, counts.film_border, counts.eye_paths};
}
// A light path has one edge less: the last leads to the eye.
inline transport::WalkRules light_rules(const PathOptions& options, const Techniques& t,
                                        const PathCounts& counts) {
  return {options.max_depth - 1, options.rr_depth, t.hit_lens, counts.film_border, counts.eye_paths};
}

}  // namespace candela::estimators
