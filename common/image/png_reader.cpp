#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include "common/image/exif.h"
#include "common/image/png.h"
#include "common/image/png_calls.h"
#include "common/image/row_reader.h"

namespace candela::image {
namespace {

static_assert(std::endian::native == std::endian::little);  // PNG's words are the other way round

constexpr std::uint64_t kMaxExpansion = 4096;  // more than deflate's, and than that of single bits to bytes

class PngReader final : public RowReader, private PngCalls {
 public:
  PngReader(std::unique_ptr<ByteSource> source, bool straight_colors)
      : source_(std::move(source)), straight_(straight_colors) {}
  ~PngReader() override { close(); }

  // Reads the file up to its pixels, anew.
  bool open();

 private:
  const void* row_at(int y) override;
  template <class Body>
  bool call(const Body& body) {
    return guarded(body) || fail(message());
  }
  static void on_read(png_structp png, png_bytep out, std::size_t count) {
    auto* const self = static_cast<PngReader*>(png_get_io_ptr(png));
    if (!self->source_->read(self->at_, count, out)) png_error(png, "the file ends too early");
    self->at_ += count;
  }
  unsigned char* row() { return reinterpret_cast<unsigned char*>(row_.data()); }
  void close() {
    if (png_ != nullptr) png_destroy_read_struct(&png_, &info_, nullptr);
    png_ = nullptr;
    info_ = nullptr;
  }
  void read_info();
  void describe();
  bool read_whole();
  // The next row, of all channels, in row_.
  bool read_row(int y);
  template <class T>
  void associate(T* row) const;

  std::unique_ptr<ByteSource> source_;
  bool straight_;
  std::uint64_t at_ = 0;
  bool interlaced_ = false;
  float gamma_ = 1;  // the power that makes values linear, where the file says one
  int next_row_ = 0;
  std::size_t row_bytes_ = 0;
  std::vector<std::uint16_t> row_;  // or bytes
  std::vector<unsigned char> whole_;
};

void PngReader::read_info() {
  png_set_read_fn(png_, this, on_read);
  png_read_info(png_, info_);
  // One, two and four bits become eight, palettes RGB, and a transparent color alpha.
  png_set_expand(png_);
  png_set_swap(png_);
  interlaced_ = png_get_interlace_type(png_, info_) != PNG_INTERLACE_NONE;
  if (interlaced_) png_set_interlace_handling(png_);
  png_read_update_info(png_, info_);
  row_bytes_ = png_get_rowbytes(png_, info_);
}

void PngReader::describe() {
  spec_ = {};
  spec_.width = static_cast<int>(png_get_image_width(png_, info_));
  spec_.height = static_cast<int>(png_get_image_height(png_, info_));
  spec_.x = png_get_x_offset_pixels(png_, info_);
  spec_.y = png_get_y_offset_pixels(png_, info_);
  spec_.display_width = spec_.width;
  spec_.display_height = spec_.height;
  const bool words = png_get_bit_depth(png_, info_) == 16;
  spec_.is_uint8 = !words;
  spec_.sample_bytes = words ? 2 : 1;
  spec_.image_bytes = std::uint64_t{row_bytes_} * static_cast<std::uint64_t>(spec_.height);
  const int channels = png_get_channels(png_, info_);
  if (channels < 3)
    spec_.channels = {"Y"};
  else
    spec_.channels = {"R", "G", "B"};
  if (channels == 2 || channels == 4) {
    spec_.alpha_channel = channels - 1;
    spec_.channels.push_back("A");
  }
  if (double power = 0;
      png_get_valid(png_, info_, PNG_INFO_sRGB) == 0 && png_get_gAMA(png_, info_, &power) != 0 && power > 0)
    gamma_ = std::round(100 * static_cast<float>(1 / power)) / 100;  // 45455 of 100000 stands for 1 / 2.2
  double c[8];
  if (png_get_cHRM(png_, info_, &c[6], &c[7], &c[0], &c[1], &c[2], &c[3], &c[4], &c[5]) != 0) {
    spec_.chromaticities.emplace();
    for (std::size_t i = 0; i < 8; ++i) (*spec_.chromaticities)[i] = static_cast<float>(c[i]);
  }
  png_bytep exif = nullptr;
  png_uint_32 exif_bytes = 0;
  if (png_get_eXIf_1(png_, info_, &exif_bytes, &exif) != 0)
    spec_.orientation = exif_orientation(exif, exif_bytes);
  png_textp texts = nullptr;
  const int count = png_get_text(png_, info_, &texts, nullptr);
  for (int i = 0; i < count; ++i) {
    if (texts[i].key != nullptr && texts[i].text != nullptr)
      spec_.texts.emplace_back(texts[i].key, texts[i].text);
  }
}

bool PngReader::open() {
  close();
  at_ = 0;
  next_row_ = 0;
  png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, static_cast<PngCalls*>(this), on_error, on_warning);
  if (png_ == nullptr) return fail("libpng does not start");
  info_ = png_create_info_struct(png_);
  if (info_ == nullptr) return fail("libpng does not start");
  if (!call([this] { read_info(); })) return false;
  describe();
  row_.resize((row_bytes_ + 1) / 2);
  return true;
}

bool PngReader::read_whole() {
  if (spec_.image_bytes / kMaxExpansion > source_->size()) return fail("the file is too short for its size");
  whole_.resize(spec_.image_bytes);
  std::vector<png_bytep> rows;
  for (std::size_t y = 0; y < static_cast<std::size_t>(spec_.height); ++y)
    rows.push_back(whole_.data() + y * row_bytes_);
  png_bytepp const first = rows.data();
  if (call([this, first] { png_read_image(png_, first); })) return true;
  whole_.clear();
  return false;
}

bool PngReader::read_row(int y) {
  if (interlaced_) {
    if (whole_.empty() && !read_whole()) return false;
    std::memcpy(row(), whole_.data() + static_cast<std::size_t>(y) * row_bytes_, row_bytes_);
    return true;
  }
  if (y < next_row_ && !open()) return false;
  for (; next_row_ <= y; ++next_row_)
    if (!call([this] { png_read_row(png_, row(), nullptr); })) return false;
  return true;
}

// Multiplies colors by alpha. Where colors are to be made linear by a power, so is the factor: it then
// multiplies linear colors by alpha.
template <class T>
void PngReader::associate(T* row) const {
  const auto channels = spec_.channels.size();
  constexpr std::uint32_t kMax = std::numeric_limits<T>::max();
  for (std::size_t x = 0; x < static_cast<std::size_t>(spec_.width); ++x, row += channels) {
    const T alpha = row[channels - 1];
    for (std::size_t c = 0; c + 1 < channels; ++c) {
      if (gamma_ == 1) {
        row[c] = static_cast<T>(std::uint32_t{row[c]} * alpha / kMax);
      } else {
        const float part = static_cast<float>(alpha) * (1.0F / static_cast<float>(kMax));
        row[c] = static_cast<T>(static_cast<float>(row[c]) * std::pow(part, gamma_));
      }
    }
  }
}

const void* PngReader::row_at(int y) {
  if (!read_row(y)) return nullptr;
  const bool multiply = spec_.alpha_channel >= 0 && !straight_;
  if (multiply && spec_.is_uint8)
    associate(row());
  else if (multiply)
    associate(row_.data());
  return row_.data();
}

}  // namespace

std::unique_ptr<ImageReader> open_png(std::unique_ptr<ByteSource> source, bool straight_colors,
                                      std::string& error) {
  auto reader = std::make_unique<PngReader>(std::move(source), straight_colors);
  if (reader->open()) return reader;
  error = reader->error();
  return nullptr;
}

std::string png_library() {
  return "libpng " PNG_LIBPNG_VER_STRING;
}

}  // namespace candela::image
