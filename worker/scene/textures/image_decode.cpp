// Image bytes to linear texels.
#include "worker/scene/textures/image_decode.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include "common/base/work_monitor.h"
#include "common/image/formats.h"
#include "worker/core/math.h"
#include "worker/scene/textures/height_image.h"
#include "worker/scene/textures/orientation.h"
#include "worker/scene/textures/pnm.h"
#include "worker/scene/textures/primaries.h"

namespace candela::scene {
namespace {

constexpr int kMaxSide = 1 << 17;
constexpr std::uint64_t kMaxPixels = std::uint64_t{1} << 34;
constexpr std::uint64_t kMaxPixelsHeldWhole = std::uint64_t{1} << 28;
constexpr std::uint64_t kChunkBytes = 8 << 20;    // of rows decoded at a time
constexpr std::uint64_t kMaxTileRow = 512 << 20;  // bytes of one row of a tiled file's tiles

Error image_error(std::string message, const std::string& file) {
  return input_error(std::move(message)).at(file, 0);
}

using image::one_line;

// True if the library needs the whole image at once, whatever rows it is asked for.
bool held_whole(std::string_view format, std::string_view bytes) {
  constexpr std::size_t png_interlace = 28;  // in the header chunk
  if (format == "png") return bytes.size() > png_interlace && bytes[png_interlace] != 0;
  return format == "jpeg" || format == "bmp" || format == "targa";
}

// The channel of pbrt's float textures: alpha as gray, if there are R, G, B and A and some pixel is not
// opaque; else the color, of which the texture takes the mean.
constexpr std::string_view kNumber = "number";
constexpr float kOpaque = 1 - 1e-6f;  // alphas from here on, but for rounding

// Bytes of the pixels before they are packed. The library reads pixels of a PNG that has less than 8 bits as
// bytes, of its palette as colors.
std::uint64_t stored_bytes(std::string_view format, std::string_view bytes, const image::ImageSpec& spec) {
  constexpr std::size_t kBitDepth = 24, kColorType = 25;  // places in the header
  constexpr char kGray = 0, kPalette = 3;
  if (format != "png" || bytes.size() <= kColorType) return spec.image_bytes;
  const char type = bytes[kColorType];
  const auto bits = static_cast<std::uint64_t>(static_cast<unsigned char>(bytes[kBitDepth]));
  if ((type != kGray && type != kPalette) || bits > 8) return spec.image_bytes;
  return static_cast<std::uint64_t>(spec.width) * static_cast<std::uint64_t>(spec.height) * bits / 8;
}

class Decoder {
 public:
  // most_heights: the values are heights, of at most so many pixels.
  Decoder(std::string_view encoded, const std::string& file, const ImageReading& reading,
          std::optional<std::uint64_t> most_heights = std::nullopt)
      : encoded_(encoded), file_(file), reading_(reading), most_heights_(most_heights) {}

  Result<TexelImage> decode(Scratch& scratch);

 private:
  Result<void> open();
  bool bytes_hold_binary_pnm() const {
    return std::string_view("56Ff").find(encoded_[1]) != std::string_view::npos;
  }
  Result<void> open_pnm();
  // Chooses the first part of an OpenEXR file that has what is wanted: colors, or the channel.
  Result<void> choose_part();
  // The names of the part's channels.
  std::string part_text() const;
  Orientation orientation() const;
  // Rows [begin, end) of the channels that are read, into `out`.
  template <class T>
  Result<void> read(int begin, int end, bool tiled, T* out);
  Result<void> check_size() const;
  int channel_named(char upper) const;
  int single_channel() const;
  Result<void> find_channels();
  float to_linear(double v) const;
  template <class T>
  Result<void> read_rows(TexelWriter& out);
  Result<void> check_row(const float* pixels, std::uint32_t y) const;
  void change_primaries(std::vector<float>& row) const;
  Error library_error(const std::string& what) const;

  std::string_view encoded_;
  const std::string& file_;
  const ImageReading& reading_;
  std::optional<std::uint64_t> most_heights_;
  std::string_view format_;
  std::unique_ptr<image::ImageReader> input_;
  image::ImageSpec spec_;
  std::optional<PnmFile> pnm_;  // in place of the library
  bool gray_ = false;
  int pick_[3] = {0, 0, 0};       // channels, counted from first_
  int first_ = 0, channels_ = 0;  // of the file, that are read
  ImageReading::Encoding encoding_ = ImageReading::Encoding::linear;
  std::optional<std::array<Vec3d, 3>> to_rec709_;
};

Error Decoder::library_error(const std::string& what) const {
  return image_error(what + one_line(input_->error()), file_);
}

Result<void> Decoder::open() {
  const char* const format = image::format_of(encoded_, file_);
  if (format == nullptr) {
    return image_error("this is no image of a known format", file_)
        .with_mend("use OpenEXR, PNG, JPEG, Radiance HDR, TIFF, BMP, TGA or PNM/PFM");
  }
  format_ = format;
  if (format_ == "pnm" && bytes_hold_binary_pnm()) return open_pnm();
  // Colors as stored: alpha plays no part here.
  auto input = image::open_bytes(encoded_, format, file_, true);
  if (!input.ok()) return std::move(input).error().at(file_, 0);
  input_ = std::move(*input);
  spec_ = input_->spec();
  return format_ == "openexr" ? choose_part() : Result<void>();
}

Result<void> Decoder::choose_part() {
  const auto has_colors = [&] {
    return channel_named('R') >= 0 && channel_named('G') >= 0 && channel_named('B') >= 0;
  };
  const auto is_wanted = [&] {
    if (spec_.deep) return false;
    if (reading_.channel.empty() || reading_.channel == kNumber) return has_colors();
    return channel_named(static_cast<char>(reading_.channel[0] - 'a' + 'A')) >= 0;
  };
  // Heights may be those of one channel.
  if (is_wanted() || (most_heights_ && single_channel() >= 0)) return {};
  // A part of one channel with a name of its own, such as a depth, is no picture in gray; luminance is.
  const auto is_gray = [&] { return !spec_.deep && single_channel() >= 0 && channel_named('Y') >= 0; };
  int gray = is_gray() ? 0 : -1, part = 1;
  std::string names = part_text();
  for (; input_->seek_part(part); ++part) {
    spec_ = input_->spec();
    if (is_wanted()) return {};
    if (gray < 0 && is_gray()) gray = part;
    names += "; " + part_text();
  }
  static_cast<void>(input_->error());  // of a part that cannot be read
  if (part > 1 && gray < 0 && (reading_.channel.empty() || reading_.channel == kNumber))
    return image_error("none of the file's " + std::to_string(part) + " parts has R, G and B: they have " +
                           one_line(names),
                       file_)
        .with_mend("store the part of interest in a file of its own, as R, G, B");
  if (!input_->seek_part(std::max(gray, 0))) return library_error("cannot read the image: ");
  spec_ = input_->spec();
  return {};
}

std::string Decoder::part_text() const {
  std::string text;
  for (const std::string& name : spec_.channels) text += (text.empty() ? "" : ", ") + name;
  return text;
}

Orientation Decoder::orientation() const {
  Orientation orientation{spec_.orientation};
  if (orientation.keeps_rows()) return {};
  // OpenImageIO takes Radiance's "+X +Y" for "-X -Y", and the other way round.
  if (format_ == "hdr" && (orientation.code == 6 || orientation.code == 8))
    orientation.code = 14 - orientation.code;
  return orientation;
}

Result<void> Decoder::open_pnm() {
  pnm_ = PnmFile::parse(encoded_);
  if (!pnm_)
    return image_error("the file's header is damaged, or it has too few bytes for its pixels", file_);
  const std::uint32_t bytes = pnm_->most == 0 ? 4 : pnm_->most == 255 ? 1 : 2;
  spec_ = {.width = pnm_->width,
           .height = pnm_->height,
           .channels =
               pnm_->channels == 1 ? std::vector<std::string>{"Y"} : std::vector<std::string>{"R", "G", "B"},
           .floating = pnm_->most == 0,
           .is_uint8 = bytes == 1,
           .sample_bytes = bytes,
           .texts = {}};
  spec_.image_bytes = static_cast<std::uint64_t>(spec_.width) * static_cast<std::uint64_t>(spec_.height) *
                      spec_.channels.size() * bytes;
  return {};
}

template <class T>
Result<void> Decoder::read(int begin, int end, bool tiled, T* out) {
  constexpr image::SampleType type = std::is_same_v<T, std::uint8_t>    ? image::SampleType::uint8
                                     : std::is_same_v<T, std::uint16_t> ? image::SampleType::uint16
                                                                        : image::SampleType::float32;
  if (pnm_) {
    // One channel, or three of three: all that a pixel has, but for a channel read alone.
    std::vector<T> row(static_cast<std::size_t>(pnm_->width) * static_cast<std::size_t>(pnm_->channels));
    for (int y = begin; y < end; ++y) {
      if (!pnm_->row(y, row.data()))
        return image_error("row " + std::to_string(y) + " has a value above the file's maximum", file_);
      for (std::size_t x = 0; x < static_cast<std::size_t>(pnm_->width); ++x) {
        for (int c = 0; c < channels_; ++c)
          *out++ = row[x * static_cast<std::size_t>(pnm_->channels) + static_cast<std::size_t>(first_ + c)];
      }
    }
    return {};
  }
  const int last = first_ + channels_;
  const bool read = tiled ? input_->read_tiles(begin, end, first_, last, type, out)
                          : input_->read_rows(begin, end, first_, last, type, out);
  if (!read) return library_error("cannot read the image's pixels: ");
  return {};
}

Result<void> Decoder::check_size() const {
  const std::uint64_t pixels = static_cast<std::uint64_t>(std::max(0, spec_.width)) *
                               static_cast<std::uint64_t>(std::max(0, spec_.height));
  const bool whole = held_whole(format_, encoded_) || !orientation().keeps_rows();
  if (spec_.width < 1 || spec_.height < 1 || spec_.width > kMaxSide || spec_.height > kMaxSide ||
      spec_.depth > 1 || pixels > (whole ? kMaxPixelsHeldWhole : kMaxPixels)) {
    return image_error("the image is " + std::to_string(spec_.width) + " x " + std::to_string(spec_.height) +
                           " pixels; up to 131072 a side and " + (whole ? "2^28" : "2^34") +
                           " in all are supported for this kind of file",
                       file_)
        .with_mend(whole ? "OpenEXR, TIFF and PNG without interlacing, stored upright, may be larger" : "");
  }
  if (most_heights_ && (spec_.width < 2 || spec_.height < 2 || pixels > *most_heights_)) {
    return image_error("the image is " + std::to_string(spec_.width) + " x " + std::to_string(spec_.height) +
                           " pixels; heights are 2 x 2 at least and " + std::to_string(*most_heights_) +
                           " in all at most",
                       file_)
        .with_mend(pixels > *most_heights_ ? "make the image smaller" : "");
  }
  if (spec_.channels.empty() || spec_.channels.size() > 64) {
    return image_error(
        "the image has " + std::to_string(spec_.channels.size()) + " channels; 1 to 64 are supported", file_);
  }
  // A few bytes must not make us fill gigabytes: no format here packs better than about 1000 to 1.
  if (stored_bytes(format_, encoded_, spec_) / 4096 > encoded_.size()) {
    return image_error("the file has " + std::to_string(encoded_.size()) + " bytes, too few for its " +
                           std::to_string(spec_.width) + " x " + std::to_string(spec_.height) + " pixels",
                       file_);
  }
  return {};
}

// The channel of this name in capital or small letters; -1 if there is none.
int Decoder::channel_named(char upper) const {
  for (std::size_t i = 0; i < spec_.channels.size(); ++i) {
    const std::string& name = spec_.channels[i];
    if (name.size() == 1 && (name[0] == upper || name[0] == upper - 'A' + 'a')) return static_cast<int>(i);
  }
  return -1;
}

// The only channel beside an alpha; -1 if there are several.
int Decoder::single_channel() const {
  if (spec_.channels.size() == 1) return 0;
  const int alpha = channel_named('A');
  return spec_.channels.size() == 2 && alpha >= 0 ? 1 - alpha : -1;
}

// Finds red, green and blue among the channels; one-channel images give all three the same.
Result<void> Decoder::find_channels() {
  int found[3];
  if (!reading_.channel.empty() && reading_.channel != kNumber) {
    found[0] = found[1] = found[2] = channel_named(static_cast<char>(reading_.channel[0] - 'a' + 'A'));
    if (found[0] < 0) return image_error("the image has no channel '" + reading_.channel + "'", file_);
    gray_ = true;
  } else {
    const char names[3] = {'R', 'G', 'B'};
    bool named = true;
    for (int c = 0; c < 3; ++c) {
      found[c] = channel_named(names[c]);
      named = named && found[c] >= 0;
    }
    if (!named) {
      const int single = single_channel();
      if (single < 0) {
        return image_error(
                   "the image has the channels " + one_line(part_text()) + ", but a color is R, G and B",
                   file_)
            .with_mend("store the layer of interest as R, G, B");
      }
      gray_ = true;
      found[0] = found[1] = found[2] = single;
    }
  }
  first_ = std::min({found[0], found[1], found[2]});
  channels_ = std::max({found[0], found[1], found[2]}) + 1 - first_;
  for (int c = 0; c < 3; ++c) pick_[c] = found[c] - first_;
  return {};
}

float Decoder::to_linear(double v) const {
  switch (encoding_) {
    case ImageReading::Encoding::srgb:
      return static_cast<float>(math::srgb_to_linear(v));
    case ImageReading::Encoding::power:
      return static_cast<float>(math::pow(v, reading_.gamma));
    case ImageReading::Encoding::file:
    case ImageReading::Encoding::linear:
      break;
  }
  return static_cast<float>(v);
}

Result<void> Decoder::check_row(const float* pixels, std::uint32_t y) const {
  const auto width = static_cast<std::size_t>(spec_.width);
  for (std::size_t x = 0; x < width; ++x) {
    for (const int c : pick_) {
      const float v = pixels[x * static_cast<std::size_t>(channels_) + static_cast<std::size_t>(c)];
      if (std::isfinite(v) && (v >= 0 || most_heights_)) continue;
      const char* const what = v != v ? "a NaN" : std::isinf(v) ? "an infinite value" : "a negative value";
      return image_error("the image has " + std::string(what) + " at pixel (" + std::to_string(x) + ", " +
                             std::to_string(y) + ")",
                         file_)
          .with_mend(most_heights_ ? "repair the image; heights are finite"
                                   : "repair the image; a texture or environment map holds finite values "
                                     "from 0 up");
    }
  }
  return {};
}

// Colors that Rec.709 cannot show lose their negative parts.
void Decoder::change_primaries(std::vector<float>& row) const {
  for (std::size_t i = 0; i < row.size(); i += static_cast<std::size_t>(channels_)) {
    float* const parts[3] = {&row[i + static_cast<std::size_t>(pick_[0])],
                             &row[i + static_cast<std::size_t>(pick_[1])],
                             &row[i + static_cast<std::size_t>(pick_[2])]};
    const Vec3d color{static_cast<double>(*parts[0]), static_cast<double>(*parts[1]),
                      static_cast<double>(*parts[2])};
    for (std::size_t c = 0; c < 3; ++c) {
      const double v = dot((*to_rec709_)[c], color);
      *parts[c] = most_heights_ ? static_cast<float>(v) : static_cast<float>(std::max(0.0, v));
    }
  }
}

// T: what the library is asked for. 16-bit integers go through a table of their own on the way to floats.
template <class T>
Result<void> Decoder::read_rows(TexelWriter& out) {
  constexpr bool words = std::is_same_v<T, std::uint16_t>;
  const auto width = static_cast<std::uint64_t>(spec_.width);
  const auto channels = static_cast<std::uint64_t>(channels_);
  const bool tiled = spec_.tile_width > 0 && spec_.tile_height > 0;
  // The library's own rows have all channels of the file.
  const std::uint64_t row_bytes = width * spec_.channels.size() * sizeof(float);
  int step = static_cast<int>(std::clamp<std::uint64_t>(kChunkBytes / row_bytes, 1, TexelImage::kTile));
  if (tiled) {
    step = spec_.tile_height;
    const std::uint64_t across = (width / static_cast<std::uint64_t>(spec_.tile_width) + 1) *
                                 static_cast<std::uint64_t>(spec_.tile_width);
    if (across * static_cast<std::uint64_t>(step) > kMaxTileRow / spec_.channels.size() / sizeof(float)) {
      return image_error("the image's tiles of " + std::to_string(spec_.tile_width) + " x " +
                             std::to_string(spec_.tile_height) + " pixels are too large",
                         file_)
          .with_mend("store it by scanlines or in smaller tiles");
    }
  }
  std::vector<float> linear;
  if constexpr (words) {
    linear.resize(65536);
    for (std::size_t v = 0; v < linear.size(); ++v) linear[v] = to_linear(static_cast<double>(v) / 65535);
  }
  std::vector<T> rows(width * channels * static_cast<std::uint64_t>(std::min(step, spec_.height)));
  std::vector<float> row(std::is_same_v<T, std::uint8_t> ? 0 : width * channels);
  using Texel = std::conditional_t<std::is_same_v<T, std::uint8_t>, std::uint8_t, float>;
  UprightRows<Texel> upright(out, orientation(), static_cast<std::uint32_t>(spec_.width),
                             static_cast<std::uint32_t>(spec_.height), channels, pick_);
  for (int y = 0; y < spec_.height; y += step) {
    work_step();
    const int end = std::min(y + step, spec_.height);
    CANDELA_TRY(read(y, end, tiled, rows.data()));
    for (int i = 0; i < end - y; ++i) {
      const T* const pixels = rows.data() + static_cast<std::size_t>(i) * width * channels;
      if constexpr (std::is_same_v<T, std::uint8_t>) {
        CANDELA_TRY(upright.add(pixels));
      } else {
        if constexpr (words) {
          for (std::size_t k = 0; k < row.size(); ++k) row[k] = linear[pixels[k]];
        } else {
          CANDELA_TRY(check_row(pixels, static_cast<std::uint32_t>(y + i)));
          for (std::size_t k = 0; k < row.size(); ++k) {
            row[k] = encoding_ == ImageReading::Encoding::linear ? pixels[k]
                                                                 : to_linear(static_cast<double>(pixels[k]));
          }
          // A power may leave the range of floats.
          if (encoding_ != ImageReading::Encoding::linear)
            CANDELA_TRY(check_row(row.data(), static_cast<std::uint32_t>(y + i)));
        }
        if (to_rec709_) change_primaries(row);
        CANDELA_TRY(upright.add(row.data()));
      }
    }
  }
  return upright.finish();
}

Result<TexelImage> Decoder::decode(Scratch& scratch) {
  CANDELA_TRY(open());
  CANDELA_TRY(check_size());
  const auto has = [&](std::string_view names) {
    return std::all_of(names.begin(), names.end(), [&](char name) { return channel_named(name) >= 0; });
  };
  if (reading_.channel == kNumber && has("RGBA")) {
    ImageReading of_alpha = reading_;
    of_alpha.channel = "a";
    CANDELA_ASSIGN(TexelImage alpha, Decoder(encoded_, file_, of_alpha).decode(scratch));
    if (alpha.minimum.r < kOpaque) return alpha;
  }
  CANDELA_TRY(find_channels());
  const bool is_integer = !spec_.floating;
  if (format_ == "openexr" && is_integer)
    return image_error("the image's channels are integers, but a color is half or float", file_);
  encoding_ = reading_.encoding;
  if (encoding_ == ImageReading::Encoding::file)
    encoding_ = is_integer ? ImageReading::Encoding::srgb : ImageReading::Encoding::linear;

  TexelImage image;
  image.file = file_;
  image.width = static_cast<std::uint32_t>(spec_.width);
  image.height = static_cast<std::uint32_t>(spec_.height);
  if (orientation().swaps_axes()) std::swap(image.width, image.height);
  if (format_ == "openexr" && spec_.chromaticities && !gray_) to_rec709_ = to_rec709(*spec_.chromaticities);
  const bool bytes = spec_.is_uint8;
  if (bytes) {
    for (std::size_t v = 0; v < image.table.size(); ++v)
      image.table[v] = to_linear(static_cast<double>(v) / 255);
  }
  image.format = bytes ? (gray_ ? TexelFormat::gray8 : TexelFormat::rgb8)
                       : (gray_ ? TexelFormat::gray32 : TexelFormat::rgb32);
  CANDELA_ASSIGN(TexelWriter out, TexelWriter::create(scratch, image));
  if (bytes) {
    CANDELA_TRY(read_rows<std::uint8_t>(out));
  } else if (is_integer) {
    CANDELA_TRY(read_rows<std::uint16_t>(out));
  } else {
    CANDELA_TRY(read_rows<float>(out));
  }
  CANDELA_TRY(out.finish(image));
  return image;
}

Result<TexelImage> decode_with(Decoder decoder, std::string_view encoded, const std::string& file,
                               Scratch& scratch) {
  if (encoded.empty()) return image_error("the image file is empty", file);
  // OpenImageIO's readers, and our own allocations, may throw on hostile files.
  try {
    return decoder.decode(scratch);
  } catch (const std::exception& e) {
    return image_error(std::string("cannot decode the image: ") + e.what(), file);
  }
}

}  // namespace

Result<TexelImage> decode_image(std::string_view encoded, const std::string& file,
                                const ImageReading& reading, Scratch& scratch) {
  return decode_with(Decoder(encoded, file, reading), encoded, file, scratch);
}

Result<TexelImage> decode_heights(std::string_view encoded, const std::string& file,
                                  std::uint64_t most_pixels, Scratch& scratch) {
  const ImageReading reading;
  return decode_with(Decoder(encoded, file, reading, most_pixels), encoded, file, scratch);
}

}  // namespace candela::scene
