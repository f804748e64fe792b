// Origin of the light of some pixels: paths of bidirectional path tracing, clustered by their strings.
//
// Recursive clustering [Kaplanyan 2017, 9.1.1.2]: paths are grouped by the vertex next to one end; the group
// with most light is split by the next vertex, and so on while there are few groups.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/letters/request.h"
#include "worker/inspect/path_sums.h"
#include "worker/inspect/session.h"

namespace candela::inspect {

struct PathsRequest {
  PixelRect pixels;
  std::optional<letters::Region> spot;  // only light that the vertex next to the eye sends from in there
  std::uint64_t spp = 16;
  bool by_object = false;   // clusters by objects, else by letters
  bool from_light = false;  // which end clustering begins at
  std::size_t rows = 12;    // groups
  std::size_t keep = 64;    // key paths
  unsigned threads = 1;
};

// A number with its standard error; NaN: not known.
struct Estimate {
  double value = 0, error = 0;
};

struct PathGroup {
  std::string expression;          // a light path expression that its paths match
  PathString common;               // their vertices next to the end where clustering begins
  Estimate share;                  // of the light of all paths, also of those that are not selected
  Vec3d mean;                      // of a pixel: linear Rec.709
  std::uint64_t count = 0;         // contributions
  std::vector<Vec3> mean_path;     // of its string with most light, from the light to the eye
  std::vector<KeyPath> key_paths;  // the first has the highest rank
};

struct PathsReport {
  std::uint64_t pixels = 0, spp = 0;
  Vec3d mean;                     // of a pixel, of all light
  Estimate luminance;             // the same
  Estimate selected;              // share of the light that the expression selects
  std::vector<PathGroup> groups;  // most light first
  // Paths of more strings, or of more vertices, than are told apart.
  Estimate other;
  std::uint64_t other_count = 0;
  bool counted = true;           // the numbers of contributions are known
  std::uint64_t not_finite = 0;  // contributions left out
};

// The ratio of two sums, from their parts by batch: the share of some light in all, or a mean over samples.
Estimate ratio_of(const std::vector<double>& parts, const std::vector<double>& wholes);

// A pure function of session and request but for threads, which change nothing. Errors: settings of the
// integrator.
Result<PathsReport> inspect_paths(const Session& session, const PathsRequest& request);

}  // namespace candela::inspect
