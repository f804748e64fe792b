// Pictures of jobs for the page: the developed image, its error, a layer, or all layers that add up to the
// image, in levels of half the size, cut into tiles.
//
// A tile of the form rgbe is 4 bytes a pixel: red, green, blue and a shared exponent
// (value = byte * 2^(exponent - 136)). A tile of the form half is 6 bytes a pixel, three half floats, which
// keep the sign, and what is dim in one channel beside much in another. The tile of a mix has its layers one
// after another. A tile's name is a hash of its bytes, so that a browser fetches what changed.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "common/base/mutex.h"
#include "common/base/result.h"

namespace candela::master {

class Farm;

inline constexpr std::uint32_t kPageTile = 256;  // pixels a side

// Content of a picture: the image, the error, one layer, or the layers of a mix.
struct PictureKind {
  enum class Kind : std::uint8_t { image, error, layer, mix };
  Kind kind = Kind::image;
  std::string layer = {};  // its name
};

enum class TileForm : std::uint8_t { rgbe, half };

// The nearest half float, ties to even; values beyond the largest one become that.
std::uint16_t half_of(float value);

class Picture {
 public:
  struct LayerName {
    std::string name, letters;
  };
  // Figures that the page shows beside the pixels.
  struct Facts {
    std::uint64_t iterations = 0;
    std::string letters = "RGB";              // of the channels that are shown
    std::vector<LayerName> layers = {};       // that the job has
    std::vector<std::string> partition = {};  // the layers that add up to the image
  };
  struct Tile {
    std::shared_ptr<const std::string> bytes;
    std::string etag;
  };
  struct Level {
    std::uint32_t width = 0, height = 0;
    std::vector<float> rgb;             // empty in a mix
    std::vector<std::uint16_t> halves;  // of a mix from level first() on: layer by layer
  };

  // Levels down to one tile. Precondition: rgb has width * height * 3 values.
  Picture(std::uint32_t width, std::uint32_t height, std::vector<float> rgb, Facts facts);
  // A mix of the layers facts.partition. `develop` gives the values of the layer with this number, as `rgb`
  // above.
  using Develop = std::function<std::vector<float>(std::size_t layer)>;
  Picture(std::uint32_t width, std::uint32_t height, Facts facts, const Develop& develop);
  // Bytes of all its levels and tiles.
  static std::uint64_t memory_bytes(std::uint32_t width, std::uint32_t height);
  static std::uint64_t mix_memory_bytes(std::uint32_t width, std::uint32_t height, std::size_t layers);
  std::uint64_t iterations() const { return facts_.iterations; }
  const Facts& facts() const { return facts_; }
  const std::vector<Level>& levels() const { return levels_; }
  // The finest level that has pixels. A mix of many layers has none of the full size.
  std::size_t first() const { return first_; }
  // Thread-safe. No bytes: there is no such tile.
  Tile tile(std::size_t level, std::uint32_t x, std::uint32_t y, TileForm form);
  // Returns what make() gave for this question, before or now: many viewers ask the same. Thread-safe.
  std::string answer(const std::string& question, const std::function<std::string()>& make);

 private:
  const Facts facts_;
  std::size_t first_ = 0;
  std::vector<Level> levels_;
  Mutex mutex_;
  // By level, x, y and form: made when somebody asked.
  std::map<std::array<std::uint32_t, 4>, Tile> tiles_ CANDELA_GUARDED_BY(mutex_);
  std::map<std::string, std::string> answers_ CANDELA_GUARDED_BY(mutex_);
};

// The image of what is merged now; or the relative standard error of each pixel: the square root of the terms
// of the estimated relMSE, averaged over 5 x 5 pixels; or a layer; or the layers that add up to the image.
// Errors (refused): nothing is merged, or for the error only one half, or the job has no such layers;
// (resource) there is no memory for it now. The film of an ended job leaves memory after it, unless it was
// there before.
Result<std::shared_ptr<Picture>> make_picture(Farm& farm, const std::string& job_id, const PictureKind& kind);

}  // namespace candela::master
