// Paths with all that is known of their vertices: enriched vertices [Kaplanyan 2017, 9.1.1.1].
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/letters/alphabet.h"
#include "common/letters/letter.h"
#include "worker/core/vec.h"
#include "worker/transport/letters/path_letters.h"

namespace candela::integrators {

struct PathVertex {
  // By color channel: a vertex with a diffuse and a glossy lobe has letters that differ, and light of several
  // environments comes from different ones.
  std::array<letters::Letter, 3> letter{};
  std::array<std::uint32_t, 3> object = {letters::kNoObject, letters::kNoObject, letters::kNoObject};
  letters::Side side = letters::Side::none;
  bool infinite = false;  // light from outside: p stands in its direction, beyond the scene
  Vec3 p;                 // of the scene
  // The throughput of the subpath that found the vertex, from its own end: the lamp or the eye.
  Spectrum throughput;
};

// Pixels of the film, both corners included.
struct PixelRect {
  std::uint32_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  std::uint64_t count() const { return (std::uint64_t{x1} - x0 + 1) * (std::uint64_t{y1} - y0 + 1); }
};

// From the light to the eye.
using RecordedPath = std::vector<PathVertex>;

// Takes the paths that are found.
class PathConsumer {
 public:
  virtual ~PathConsumer() = default;
  // value: added to the sum over pixels and samples. key: names the contribution among all of a run. labels:
  // of the path; null: nobody asks for layers.
  virtual void add(const RecordedPath& path, Spectrum value, std::uint64_t key,
                   const transport::ChannelLabels* labels) = 0;
};

}  // namespace candela::integrators
