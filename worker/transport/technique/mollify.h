// Connections of a vertex that scatters by a delta lobe, mollified (regularise.h). Each gives the value of
// its estimator; whether it counts is a question of the path's string. [regularisation note, sections 4, 5]
#pragma once

#include "worker/scene/turning_lobes.h"
#include "worker/transport/regularise.h"
#include "worker/transport/technique/contribution.h"

namespace candela::transport {

// The delta lobes at a vertex, for a walk that arrived there. Directions are in the world's coordinates, and
// attenuations include the correction for shading normals. u_lobe, u: see scene::turning_lobes.
scene::TurningLobes lobes_at(const ScatterPoint& v, float u_lobe, Vec2 u, TransportMode mode);

// The sum of the attenuations of the lobes whose cones contain `to`, the vector to the other end of the edge.
// A cone ends at the surface.
Spectrum lobes_towards(const scene::TurningLobes& lobes, Vec3 ng, Vec3d to, const Mollifier& mollifier);

// An end of a connection: a vertex that scatters by its lobes, or, if they are null, by all that is not
// delta.
struct MollifiedEnd {
  const ScatterPoint& v;
  const scene::TurningLobes* lobes;
};

// s, t >= 2: the light's vertex and the eye's, of which one has lobes.
bool mollified_connect(const ConnectContext& c, const MollifiedEnd& light, const MollifiedEnd& eye,
                       std::uint64_t stream_key, const Mollifier& mollifier, Contribution& out);

// s = 1: the eye's vertex v and a light that is a point or a direction, drawn as seen from v with `front` 0.
// length: of the edge; if the light is infinitely far away, the scene's diameter.
bool mollified_light(const ConnectContext& c, const ScatterPoint& v, const scene::TurningLobes& lobes,
                     const scene::DirectSample& light, std::uint64_t stream_key, const Mollifier& mollifier,
                     Contribution& out, double& length);

// t = 1: the light's vertex z and the lens, a point, or a direction.
bool mollified_lens(const ConnectContext& c, const ScatterPoint& z, const scene::TurningLobes& lobes,
                    std::uint64_t stream_key, const Mollifier& mollifier, FilmPosition& film,
                    Contribution& out, double& length);

// The length that counts for an edge to what is infinitely far away. [regularisation note, section 10]
double far_length(const scene::Scene& scene);

// The value, without the throughput before v, of what a light drawn as above adds to v's lobes, unoccluded.
Spectrum light_in_lobes(const scene::Scene& scene, const SurfaceHit& v, const scene::TurningLobes& lobes,
                        const scene::DirectSample& light, const Mollifier& mollifier, double& length);

}  // namespace candela::transport
