// From the vertices of a path to the path in its scene, on which formulas work.
#pragma once

#include <optional>

#include "worker/scene/scene.h"
#include "worker/transport/film_position.h"
#include "worker/transport/path/found_surfaces.h"
#include "worker/transport/path/full_path.h"
#include "worker/transport/path/path.h"

namespace candela::transport::path {

// True if the scene has the points, emitters and media that the path names.
bool exists(const scene::Scene& scene, const Path& path);

struct Assembled {
  FullPath path;
  PathVector<PathEdge> edges;
  PathVector<Vec3d> places;  // of vertices on surfaces and in media
  FilmPosition film;
};

// Another path of the same scene and border, and the numbers of vertices, from the light's end and from the
// sensor's, that are the same in both paths.
struct SharedVertices {
  const Assembled* of = nullptr;  // null: none
  std::size_t light = 0, sensor = 0;
};
// The vertices of `from` that `to` has too. Precondition: `of` is `from`, assembled.
SharedVertices shared_vertices(const Assembled& of, const Path& from, const Path& to);

// film_border: as of Scene::sample_camera. shared: what follows from shared vertices alone is copied; the
// result is the same to the bit. found: surfaces of the path that were met already; null: none. Nothing: an
// end cannot see its neighbor, whatever lies between them. Precondition: the path is well-formed, and exists
// in the scene.
std::optional<Assembled> assemble(const scene::Scene& scene, const Path& path, float film_border = 0,
                                  const SharedVertices& shared = {}, const FoundSurfaces* found = nullptr);
// Assembles into `out`, a new object, so that callers of many paths move none. False: assemble() gives
// nothing.
bool assemble_into(Assembled& out, const scene::Scene& scene, const Path& path, float film_border,
                   const SharedVertices& shared, const FoundSurfaces* found);

// The path's vertices by name: of a path that walks made. u_lens: where on the lens it ends. Nothing: a
// surface of it is not found again.
std::optional<Path> canonical(const scene::Scene& scene, const FullPath& path, Vec2 u_lens);

}  // namespace candela::transport::path
