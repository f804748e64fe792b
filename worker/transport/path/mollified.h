// Paths of which one vertex is mollified (transport/regularise.h): at this vertex a delta lobe has the form
// of a cone, and the path turns by it like by any lobe that is not delta. The vertex is at one end of an
// edge, which is that of the technique that mollifies the path: the cone's axis follows from the edge at its
// other side. Which vertex and which edge follow from the path's letters and lengths.
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "worker/transport/path/assemble.h"
#include "worker/transport/path/path.h"
#include "worker/transport/regularise.h"

namespace candela::transport::path {

struct MollifiedVertex {
  std::size_t vertex = 0;
  Cone cone = Cone::none;  // towards the other end of the edge

  // The number of vertices from the light of the technique whose edge it is.
  std::size_t technique() const { return cone == Cone::towards_light ? vertex : vertex + 1; }
};

// The mollified vertex of a path that has one flag `mollified`. Nothing: some technique can sample the path,
// or another vertex or edge is the path's.
std::optional<MollifiedVertex> mollified_vertex(const scene::Scene& scene, const Path& path,
                                                std::span<const PathEdge> edges);

}  // namespace candela::transport::path
