// Radiance along rays that need not be the camera's, by the path tracer: maps of directions, and previews.
//
// Maps are in latitude and longitude as Mitsuba's envmap has them: the top row is +y, and column u of 1 looks
// along (sin 2 pi u, 0, -cos 2 pi u). So a map can be the envmap of another scene.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "common/base/result.h"
#include "worker/inspect/session.h"

namespace candela::inspect {

// Rays of direction d start on the disk across d around the center; with a normal, on the disk across the
// normal, in directions of its side alone.
struct Probe {
  Vec3 center;  // of the scene
  double radius = 0;
  std::optional<Vec3> normal;  // unit
  float error = 0;             // of the center: rays of a disk on a surface begin so far above it
};

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

// The settings of the session's job are those of `path`. Lamps that no ray can meet (points, directions) are
// in the light of surfaces alone. Errors: settings; a probe in another medium than the camera's.
Result<RadianceMap> map_radiance(const Session& session, const MapRequest& request);

// The direction that place (u, v) of a map looks in, both in [0, 1].
Vec3 map_direction(double u, double v);

// The picture of the camera, of this size; linear Rec.709. Deterministic, whatever the threads.
std::vector<float> preview(const Session& session, std::uint32_t width, std::uint32_t height,
                           std::uint64_t spp, unsigned threads);

}  // namespace candela::inspect
