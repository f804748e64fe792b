// Interface of readers of image files, and the module (base/module.h) that has those of other formats than
// OpenEXR, PNG and JPEG, and writes JPEG: OpenImageIO brings 260 libraries, and loading them takes a third of
// a second of processor time.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"

namespace candela::image {

enum class SampleType : std::uint8_t { uint8, uint16, float32 };

// The head of an image, or of a part of one.
struct ImageSpec {
  int x = 0, y = 0, z = 0, width = 0, height = 0, depth = 1;  // of the pixels that are stored
  int tile_width = 0, tile_height = 0;                        // 0: scanlines
  std::vector<std::string> channels;
  int alpha_channel = -1, z_channel = -1;
  bool floating = false;  // samples are of half, float or double
  bool is_uint8 = false;
  std::uint32_t sample_bytes = 0;  // of one, in the file
  std::uint64_t image_bytes = 0;   // of all, in the file's types
  bool deep = false;               // a list of samples a pixel
  // The picture that they are a part of, or reach beyond.
  int display_x = 0, display_y = 0, display_width = 0, display_height = 0;
  std::string part = {};  // its name, where it has one
  int orientation = 1;    // as TIFF counts; 1: rows from the top, from the left
  std::optional<std::array<float, 8>> chromaticities = {};  // x and y of red, green, blue, white
  std::vector<std::pair<std::string, std::string>> texts;   // attributes that are text
};

// An open image file. After a call that returned false, error() says why, and is empty afterwards.
class ImageReader {
 public:
  virtual ~ImageReader() = default;
  virtual const ImageSpec& spec() const = 0;  // of the part that was sought last
  virtual bool seek_part(int part) = 0;       // from 0; false: there are no more
  // Channels [first, last), interleaved, of a whole part, of rows, or of a row of tiles of the first part.
  virtual bool read_part(int part, int first, int last, SampleType type, void* out) = 0;
  virtual bool read_rows(int begin, int end, int first, int last, SampleType type, void* out) = 0;
  virtual bool read_tiles(int begin, int end, int first, int last, SampleType type, void* out) = 0;
  virtual std::string error() = 0;
};

// Gives rows [begin, end) of all channels, interleaved, in the type that was said.
using RowSource = std::function<void(int begin, int end, void* out)>;

// Readers and writers of formats, by OpenImageIO's names ("jpeg", "tiff"). Functions that fail return null or
// false and say why; those of the library may also throw std::exception on hostile files.
class ImageCodec {
 public:
  virtual ~ImageCodec() = default;
  virtual std::string library() const = 0;  // name and version, for people
  virtual std::unique_ptr<ImageReader> open_file(const std::string& path, std::string& error) const = 0;
  // Bytes that outlive the reader. `name`: that of the file, for messages. straight_colors: as stored, where
  // the format says that they are not multiplied by alpha.
  virtual std::unique_ptr<ImageReader> open_bytes(std::string_view bytes, const char* format,
                                                  const std::string& name, bool straight_colors,
                                                  std::string& error) const = 0;
  // An encoded file of three channels of sRGB, `type` uint8 or uint16, interleaved, row by row from the top.
  // `quality`: of JPEG, 1 to 100. Empty with `error` if it fails.
  virtual std::string encode(const char* format, int width, int height, SampleType type, const void* pixels,
                             int quality, std::string& error) const = 0;
};

// Loaded once.
Result<const ImageCodec*> image_codec();

// Fails if the module is not there; loads nothing: a worker should know before it serves for a night.
Result<void> check_image_module();

}  // namespace candela::image

// The module's only symbol. Its number changes with the interface above.
extern "C" const candela::image::ImageCodec* candela_image_codec_3();
