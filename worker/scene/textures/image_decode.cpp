// Image bytes to linear texels, through OpenImageIO. Its types stay inside this file.
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <cmath>
#include <exception>

#include "worker/core/math.h"
#include "worker/scene/textures/texture.h"

namespace candela::scene {
namespace {

constexpr int kMaxSide = 32768;
constexpr std::uint64_t kMaxPixels = std::uint64_t{1} << 28;

Error image_error(std::string message, const std::string& file) {
  return input_error(std::move(message)).at(file, 0);
}

// IEC 61966-2-1.
float srgb_to_linear(double v) {
  return static_cast<float>(v <= 0.04045 ? v / 12.92 : math::pow((v + 0.055) / 1.055, 2.4));
}

// OpenImageIO's name of the format, by the bytes the file begins with (names lie); TGA has no such bytes.
// Null: none we read.
const char* format_of(std::string_view bytes, std::string_view file) {
  using namespace std::string_view_literals;
  if (bytes.starts_with("\x76\x2f\x31\x01"sv)) return "openexr";
  if (bytes.starts_with("\x89PNG\r\n\x1a\n"sv)) return "png";
  if (bytes.starts_with("\xff\xd8\xff"sv)) return "jpeg";
  if (bytes.starts_with("#?RADIANCE"sv) || bytes.starts_with("#?RGBE"sv)) return "hdr";
  if (bytes.starts_with("II*\0"sv) || bytes.starts_with("MM\0*"sv)) return "tiff";
  if (bytes.starts_with("BM"sv)) return "bmp";
  if (bytes.size() > 2 && bytes[0] == 'P' && "123456Ff"sv.find(bytes[1]) != std::string_view::npos)
    return "pnm";
  if (file.ends_with(".tga") || file.ends_with(".TGA")) return "targa";
  return nullptr;
}

// Where red, green and blue are among the channels; one-channel images give all three the same.
void find_channels(const OIIO::ImageSpec& spec, int (&channel)[3]) {
  const char* const names[3] = {"R", "G", "B"};
  bool named = true;
  for (int c = 0; c < 3; ++c) {
    channel[c] = spec.channelindex(names[c]);
    named = named && channel[c] >= 0;
  }
  if (named) return;
  const bool colour = spec.nchannels >= 3;
  for (int c = 0; c < 3; ++c) channel[c] = colour ? c : 0;
}

Result<TexelImage> decode(std::string_view encoded, const std::string& file, bool raw) {
  const char* const format = format_of(encoded, file);
  if (format == nullptr) {
    return image_error("this is no image of a known format", file)
        .with_mend("use OpenEXR, PNG, JPEG, Radiance HDR, TIFF, BMP, TGA or PNM/PFM");
  }
  auto input = OIIO::ImageInput::create(format);
  // The bytes are all there is: a reader that would open a file by name instead must not be asked.
  if (!input || !input->supports("ioproxy")) {
    return image_error(std::string("this OpenImageIO cannot decode the format ") + format + " from memory",
                       file);
  }
  OIIO::Filesystem::IOMemReader reader(encoded.data(), encoded.size());
  OIIO::ImageSpec config;
  config.attribute("oiio:UnassociatedAlpha", 1);  // colours as stored: alpha plays no part here
  OIIO::ImageSpec opened;
  if (!input->set_ioproxy(&reader) || !input->open(file, opened, config)) {
    std::string reason = input->geterror();
    std::replace(reason.begin(), reason.end(), '\n', ' ');
    return image_error("cannot decode the image: " + reason, file);
  }
  const OIIO::ImageSpec spec = input->spec();
  if (spec.width < 1 || spec.height < 1 || spec.width > kMaxSide || spec.height > kMaxSide ||
      static_cast<std::uint64_t>(spec.width) * static_cast<std::uint64_t>(spec.height) > kMaxPixels ||
      spec.depth > 1) {
    return image_error("the image is " + std::to_string(spec.width) + " x " + std::to_string(spec.height) +
                           " pixels; up to 32768 a side and 2^28 in all are supported",
                       file);
  }
  if (spec.nchannels < 1 || spec.nchannels > 64) {
    return image_error("the image has " + std::to_string(spec.nchannels) + " channels; 1 to 64 are supported",
                       file);
  }
  // A few bytes must not make us allocate gigabytes: no format here packs better than about 1000 to 1.
  const std::uint64_t decoded_bytes = spec.image_bytes(true);
  if (decoded_bytes / 4096 > encoded.size()) {
    return image_error("the file has " + std::to_string(encoded.size()) + " bytes, too few for its " +
                           std::to_string(spec.width) + " x " + std::to_string(spec.height) + " pixels",
                       file);
  }
  int channel[3];
  find_channels(spec, channel);

  TexelImage image;
  image.file = file;
  image.width = static_cast<std::uint32_t>(spec.width);
  image.height = static_cast<std::uint32_t>(spec.height);
  const std::size_t pixels = static_cast<std::size_t>(image.width) * image.height;
  const auto channels = static_cast<std::size_t>(spec.nchannels);
  const bool is_bytes = spec.format == OIIO::TypeDesc::UINT8;
  const bool is_integer = !spec.format.is_floating_point();
  const auto failed = [&] {
    std::string reason = input->geterror();
    std::replace(reason.begin(), reason.end(), '\n', ' ');
    return image_error("cannot read the image's pixels: " + reason, file);
  };

  if (is_bytes) {
    std::vector<std::uint8_t> all(pixels * channels);
    if (!input->read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::UINT8, all.data())) return failed();
    image.bytes.assign(pixels * 4, 0);
    for (std::size_t i = 0; i < pixels; ++i) {
      for (std::size_t c = 0; c < 3; ++c)
        image.bytes[4 * i + c] = all[i * channels + static_cast<std::size_t>(channel[c])];
    }
    image.table.resize(256);
    for (int v = 0; v < 256; ++v) {
      image.table[static_cast<std::size_t>(v)] =
          raw ? static_cast<float>(v / 255.0) : srgb_to_linear(v / 255.0);
    }
    return image;
  }

  std::vector<float> all(pixels * channels);
  if (!input->read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::FLOAT, all.data())) return failed();
  image.floats.resize(pixels * 3);
  for (std::size_t i = 0; i < pixels; ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      float v = all[i * channels + static_cast<std::size_t>(channel[c])];
      if (!std::isfinite(v) || v < 0) {
        const char* const what = v != v ? "a NaN" : v < 0 ? "a negative value" : "an infinite value";
        return image_error("the image has " + std::string(what) + " at pixel (" +
                               std::to_string(i % image.width) + ", " + std::to_string(i / image.width) + ")",
                           file)
            .with_mend("repair the image; a texture or environment map holds finite values from 0 up");
      }
      if (is_integer && !raw) v = srgb_to_linear(v);
      image.floats[3 * i + c] = v;
    }
  }
  return image;
}

}  // namespace

Result<TexelImage> decode_image(std::string_view encoded, const std::string& file, bool raw) {
  if (encoded.empty()) return image_error("the image file is empty", file);
  // OpenImageIO's readers, and our own allocations, may throw on hostile files.
  try {
    return decode(encoded, file, raw);
  } catch (const std::exception& e) {
    return image_error(std::string("cannot decode the image: ") + e.what(), file);
  }
}

}  // namespace candela::scene
