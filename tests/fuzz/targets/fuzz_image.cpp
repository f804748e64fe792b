// decode_image and decode_heights on any bytes: a format told by content, else TGA. Texels beyond a megabyte
// go to the scratch file. And the readers of OpenEXR and PNG as read_image() calls them: every part, colors
// multiplied by alpha.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "common/image/formats.h"
#include "worker/scene/textures/height_image.h"
#include "worker/scene/textures/image_decode.h"

namespace {

void read_parts(std::string_view bytes, const char* format) {
  namespace image = candela::image;
  const auto reader = image::open_bytes(bytes, format, "x", false);
  if (!reader.ok()) {
    if (reader.error().to_string().find('\n') != std::string::npos) std::abort();
    return;
  }
  for (int part = 0; (*reader)->seek_part(part); ++part) {
    const image::ImageSpec spec = (*reader)->spec();
    const auto samples = static_cast<std::uint64_t>(spec.width) * static_cast<std::uint64_t>(spec.height) *
                         spec.channels.size();
    if (spec.channels.empty() || samples > (1 << 20)) continue;
    std::vector<float> out(samples);
    (void)(*reader)->read_part(part, 0, static_cast<int>(spec.channels.size()), image::SampleType::float32,
                               out.data());
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace candela::scene;
  TextureLimits limits;
  limits.memory_bytes = 1 << 20;
  Scratch scratch(limits);
  ImageReading reading;
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  if (size % 8 == 5) {
    const char* const format = candela::image::format_of(bytes, "x");
    for (const std::string_view own : {"openexr", "png"})
      if (format != nullptr && format == own) read_parts(bytes, format);
  }
  if (size % 8 == 3) {
    const auto heights = decode_heights(bytes, "x.tga", 1 << 20, scratch);
    if (!heights.ok()) return 0;
    if (heights->width < 2 || heights->height < 2) std::abort();
    for (std::uint32_t i = 0; i < std::min(heights->width, heights->height); ++i) {
      const candela::Spectrum s = heights->at(i, i);
      if (!std::isfinite(s.r) || !std::isfinite(s.g) || !std::isfinite(s.b)) std::abort();
    }
    return 0;
  }
  if (size % 8 == 1) reading.channel = "a";
  if (size % 8 == 2) reading.encoding = ImageReading::Encoding::power, reading.gamma = 2.2;
  const auto image = decode_image(bytes, "x.tga", reading, scratch);
  if (!image.ok()) {
    if (image.error().to_string().find('\n') != std::string::npos) std::abort();
    return 0;
  }
  for (std::uint32_t y = 0; y < image->height; y += 1 + image->height / 8) {
    for (std::uint32_t x = 0; x < image->width; x += 1 + image->width / 8) {
      const candela::Spectrum s = image->at(x, y);
      for (const auto& [value, low, high] : {std::tuple(s.r, image->minimum.r, image->maximum.r),
                                             {s.g, image->minimum.g, image->maximum.g},
                                             {s.b, image->minimum.b, image->maximum.b}})
        if (!std::isfinite(value) || value < low || value > high) std::abort();
    }
  }
  return 0;
}
