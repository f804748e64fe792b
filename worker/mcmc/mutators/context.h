// The scene and the film of a chain's paths, and their lengths, for those who make them.
#pragma once

#include <cstdint>

#include "worker/scene/scene.h"
#include "worker/transport/path/found_surfaces.h"
#include "worker/transport/path/full_path.h"

namespace candela::mcmc {

struct MutatorContext {
  const scene::Scene& scene;  // must outlive the mutators
  // Film in pixels, and the pixels around it that count as on it: paths from the eye are uniform over both.
  double film_width = 1, film_height = 1;
  float film_border = 0;
  // Lengths of the chain's paths, in edges; others are not proposed. min_edges >= 2.
  std::uint32_t min_edges = 2, max_edges = 64;
  double bandwidth = 0;  // of mollified vertices; 0: no path has one
  // Counts the rays that proposals and evaluations of paths take; null: nobody does. Not for two threads.
  std::uint64_t* rays = nullptr;

  // Gets the surfaces that proposals meet, for the evaluation of the path; null: nobody asks.
  transport::path::FoundSurfaces* found = nullptr;

  double domain_area() const {  // pixels^2
    const double border = 2 * static_cast<double>(film_border);
    return (film_width + border) * (film_height + border);
  }
  transport::path::Rules rules() const {
    transport::path::Rules rules;
    rules.film_border = film_border;
    rules.eye_paths = film_width * film_height / domain_area();
    rules.bandwidth = bandwidth;
    rules.rays = rays;
    return rules;
  }
};

}  // namespace candela::mcmc
