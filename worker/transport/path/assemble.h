// From the vertices of a path to the path in its scene, on which formulas work.
#pragma once

#include <optional>
#include <vector>

#include "worker/scene/scene.h"
#include "worker/transport/film_position.h"
#include "worker/transport/path/full_path.h"
#include "worker/transport/path/path.h"

namespace candela::transport::path {

// True if the scene has the points, emitters and media that the path names.
bool exists(const scene::Scene& scene, const Path& path);

struct Assembled {
  FullPath path;
  std::vector<PathEdge> edges;
  FilmPosition film;
};

// film_border: as of Scene::sample_camera. Nothing: an end cannot see its neighbor, whatever lies between
// them. Precondition: the path is well-formed, and exists in the scene.
std::optional<Assembled> assemble(const scene::Scene& scene, const Path& path, float film_border = 0);

// The path's vertices by name: of a path that walks made. u_lens: where on the lens it ends. Nothing: a
// surface of it is not found again.
std::optional<Path> canonical(const scene::Scene& scene, const FullPath& path, Vec2 u_lens);

}  // namespace candela::transport::path
