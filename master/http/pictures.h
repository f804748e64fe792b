// Pictures of jobs for the page: the developed image or its error, in levels of half the size, cut into
// tiles.
//
// A tile is 4 bytes a pixel: red, green, blue and a shared exponent (value = byte * 2^(exponent - 136)). Its
// name is a hash of its bytes, so that a browser fetches what changed.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "common/base/mutex.h"
#include "common/base/result.h"

namespace candela::master {

class Farm;

inline constexpr std::uint32_t kPageTile = 256;  // pixels a side

class Picture {
 public:
  struct Tile {
    std::shared_ptr<const std::string> bytes;
    std::string etag;
  };
  struct Level {
    std::uint32_t width = 0, height = 0;
    std::vector<float> rgb;
  };

  // Levels down to one tile. Precondition: rgb has width * height * 3 values.
  Picture(std::uint32_t width, std::uint32_t height, std::vector<float> rgb, std::uint64_t iterations);
  // Of all its levels and tiles.
  static std::uint64_t memory_bytes(std::uint32_t width, std::uint32_t height);
  std::uint64_t iterations() const { return iterations_; }
  const std::vector<Level>& levels() const { return levels_; }
  // Thread-safe. No bytes: there is no such tile.
  Tile tile(std::size_t level, std::uint32_t x, std::uint32_t y);

 private:
  const std::uint64_t iterations_;
  std::vector<Level> levels_;
  Mutex mutex_;
  std::map<std::array<std::uint32_t, 3>, Tile> tiles_ CANDELA_GUARDED_BY(mutex_);  // made when somebody asked
};

// The image of what is merged now, or the relative standard error of each pixel: the square root of the terms
// of the estimated relMSE, averaged over 5 x 5 pixels. Errors (refused): nothing is merged, or for the error
// only one half; (resource) there is no memory for it now. The film of an ended job leaves memory after it,
// unless it was there before.
Result<std::shared_ptr<Picture>> make_picture(Farm& farm, const std::string& job_id, bool error);

}  // namespace candela::master
