#include <zlib.h>

#include <new>
#include <stdexcept>
#include <vector>

#include "common/image/formats.h"
#include "common/image/png_calls.h"

namespace candela::image {
namespace {

constexpr int kChannels = 3, kDepth = 8;
constexpr int kCompression = 6;

class PngWriter : private PngCalls {
 public:
  PngWriter() {
    png_ = png_create_write_struct(PNG_LIBPNG_VER_STRING, static_cast<PngCalls*>(this), on_error, on_warning);
    if (png_ != nullptr) info_ = png_create_info_struct(png_);
    if (info_ != nullptr) return;
    png_destroy_write_struct(&png_, nullptr);
    throw std::bad_alloc();
  }
  ~PngWriter() { png_destroy_write_struct(&png_, &info_); }

  void begin(png_uint_32 width, png_uint_32 height) {
    call([this, width, height] {
      png_set_write_fn(png_, this, on_write, on_flush);
      png_set_IHDR(png_, info_, width, height, kDepth, PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE,
                   PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
      png_set_compression_level(png_, kCompression);
      png_set_compression_strategy(png_, Z_DEFAULT_STRATEGY);
      png_set_sRGB_gAMA_and_cHRM(png_, info_, PNG_sRGB_INTENT_ABSOLUTE);
      png_write_info(png_, info_);
    });
  }
  void row(const unsigned char* pixels) {
    call([this, pixels] { png_write_row(png_, pixels); });
  }
  std::string end() {
    call([this] { png_write_end(png_, nullptr); });
    return std::move(bytes_);
  }

 private:
  template <class Body>
  void call(const Body& body) {
    if (!guarded(body)) throw std::runtime_error(message());
  }
  static void on_write(png_structp png, png_bytep from, std::size_t count) {
    std::string& bytes = static_cast<PngWriter*>(png_get_io_ptr(png))->bytes_;
    bool fits = true;
    try {
      bytes.append(reinterpret_cast<const char*>(from), count);
    } catch (const std::bad_alloc&) {
      fits = false;  // an exception may not pass through libpng
    }
    if (!fits) png_error(png, "the image does not fit into memory");
  }
  static void on_flush(png_structp) {}

  std::string bytes_;
};

}  // namespace

std::string write_png(const ImageSpec& spec, const RowSource& rows) {
  PngWriter writer;
  writer.begin(static_cast<png_uint_32>(spec.width), static_cast<png_uint_32>(spec.height));
  std::vector<unsigned char> row(static_cast<std::size_t>(spec.width) * kChannels);
  for (int y = 0; y < spec.height; ++y) {
    rows(y, y + 1, row.data());
    writer.row(row.data());
  }
  return writer.end();
}

}  // namespace candela::image
