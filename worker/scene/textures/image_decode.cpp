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
  OIIO::Filesystem::IOMemReader reader(encoded.data(), encoded.size());
  OIIO::ImageSpec config;
  config.attribute("oiio:UnassociatedAlpha", 1);  // colours as stored: alpha plays no part here
  auto input = OIIO::ImageInput::open(file, &config, &reader);
  if (!input) {
    std::string reason = OIIO::geterror();
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
