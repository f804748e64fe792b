// A stretch of a path as a chain of half vectors in its scene, and back [half-vector note, sections 5, 13 and
// 16].
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "worker/scene/scene.h"
#include "worker/transport/manifold/chain.h"
#include "worker/transport/manifold/surfaces.h"
#include "worker/transport/path/assemble.h"
#include "worker/transport/path/path.h"

namespace candela::transport::path {

struct Segment {
  std::size_t begin = 0, end = 0;  // of the path's vertices, the ends of the chain
  manifold::Chain chain;
  std::vector<double> alphas;        // by inner vertex of the chain; 0: the path turns there by a delta lobe
  std::vector<std::uint32_t> bsdfs;  // by inner vertex of the chain
};

// Why a stretch is no chain. All but the last are facts of its vertices.
enum class NoSegment : std::uint8_t {
  none,
  medium,        // a vertex of it is in a medium
  far_sensor,    // it ends at a sensor infinitely far away
  map,           // a bump or normal map turns a shading normal
  no_lobe,       // the bsdf has no lobe for the sides that the path is on
  index_matched  // it passes a surface that hardly bends light
};

// The stretch from vertex `begin` to vertex `end` of the path. Precondition: there are vertices in between,
// and the path was assembled.
NoSegment make_segment(const scene::Scene& scene, const Path& path, const Assembled& assembled,
                       std::size_t begin, std::size_t end, Segment& out);

// The smallest alpha of the lobes by which the path may turn at vertex i, a surface, on whichever side of it;
// of delta lobes if it turns by such. Infinity: there are none.
double least_alpha(const scene::Scene& scene, const Path& path, const Assembled& assembled, std::size_t i);

// The path whose inner vertices of the segment are those of the chain.
Path with_segment(const Path& path, const Segment& segment, const manifold::Chain& chain);

// All of an end of a chain that follows from its point on a surface. False: its surface has no tangents
// there.
bool set_end_surface(const scene::Scene& scene, const scene::CanonicalPoint& point, manifold::ChainVertex& v);

// Surfaces for the rays of a segment's walk. A null surface of another bsdf is passed.
class SceneSurfaces final : public manifold::Surfaces {
 public:
  // All must outlive this. rays: counts them; null: nobody does.
  SceneSurfaces(const scene::Scene& scene, const Segment& segment, std::uint64_t* rays = nullptr)
      : scene_(scene), segment_(segment), rays_(rays) {}
  bool meet(std::size_t i, const manifold::ChainVertex& from, Vec3d towards,
            manifold::ChainVertex& out) const override;

 private:
  const scene::Scene& scene_;
  const Segment& segment_;
  std::uint64_t* rays_;
};

// Pixels per unit of the tangent coordinates at `v`, the vertex before the sensor: by differences over
// 2^-10 of the distance `length` to it. Nothing: the sensor does not see the place.
std::optional<manifold::Mat2> to_film(const scene::Scene& scene, const manifold::ChainVertex& v,
                                      double length, Vec2 u_lens);

}  // namespace candela::transport::path
