// Radiance along rays that need not be the camera's, by the path tracer: maps of directions
// (integrators/sphere/probe.h), and previews.
#pragma once

#include <cstdint>
#include <vector>

#include "common/base/result.h"
#include "worker/inspect/session.h"
#include "worker/integrators/sphere/probe.h"

namespace candela::inspect {

using integrators::map_direction;
using integrators::Probe;

// The surface that the camera sees at the center of a pixel: a disk on its visible side. Errors (usage): none
// is there.
Result<Probe> probe_of_pixel(const Session& session, std::uint32_t x, std::uint32_t y);

struct MapRequest {
  Probe probe;
  std::uint32_t width = 512, height = 256;
  std::uint64_t spp = 16;
  unsigned threads = 1;
};

struct RadianceMap {
  std::uint32_t width = 0, height = 0;
  std::vector<float> rgb;        // radiance that arrives from each direction; row by row from the top
  Vec3d fluence;                 // its integral over directions
  Vec3d irradiance;              // the same times the cosine to the normal; without a normal 0
  std::uint64_t not_finite = 0;  // samples left out
};

// Fills fluence and irradiance of a map that has its pixels, by the pixels' middles.
void integrate_map(const Probe& probe, RadianceMap& map);

// Fails (usage) if the probe is in another medium than the camera.
Result<void> check_medium(const Session& session, const Probe& probe);

// The settings of the session's job are those of `path`. Lamps that no ray can meet (points, directions) are
// in the light of surfaces alone. Errors: settings; a probe in another medium than the camera's.
Result<RadianceMap> map_radiance(const Session& session, const MapRequest& request);

// The picture of the camera, of this size; linear Rec.709. Deterministic, whatever the threads.
std::vector<float> preview(const Session& session, std::uint32_t width, std::uint32_t height,
                           std::uint64_t spp, unsigned threads);

}  // namespace candela::inspect
