#include "common/image/picture.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <exception>
#include <limits>
#include <new>
#include <span>
#include <vector>

#include "common/image/codec.h"
#include "common/image/formats.h"

namespace candela::image {
namespace {

// Codes from 0 to the type's largest. Values at the ends of a range have the codes at the ends.
template <class Code>
void encode_row(std::span<const float> rgb, const Tone& tone, Code* to) {
  constexpr double top = std::numeric_limits<Code>::max();
  const double factor = std::exp2(tone.exposure_stops);
  for (std::size_t i = 0; i < rgb.size(); i += 3, to += 3) {
    if (std::isnan(rgb[i]) || std::isnan(rgb[i + 1]) || std::isnan(rgb[i + 2])) {
      to[0] = to[2] = std::numeric_limits<Code>::max();  // magenta
      to[1] = 0;
      continue;
    }
    for (std::size_t c = 0; c < 3; ++c) {
      double shown = 0;
      if (tone.range) {
        const auto& [low, high] = *tone.range;
        shown = std::clamp((double{rgb[i + c]} - low) / (high - low), 0.0, 1.0);
      } else {
        shown = std::clamp(double{rgb[i + c]} * factor, 0.0, 1.0);
        shown = double{linear_to_srgb(static_cast<float>(shown))};
      }
      to[c] = static_cast<Code>(top * shown + 0.5);
    }
  }
}

template <class Code>
Result<std::string> encode_by_module(const Image& image, const char* format, SampleType type,
                                     const Tone& tone) {
  CANDELA_ASSIGN(const ImageCodec* const codec, image_codec());
  std::vector<Code> codes(image.rgb.size());
  encode_row<Code>(image.rgb, tone, codes.data());
  std::string error;
  std::string bytes = codec->encode(format, static_cast<int>(image.width), static_cast<int>(image.height),
                                    type, codes.data(), tone.jpeg_quality, error);
  if (bytes.empty())
    return failed_error("cannot encode the image as " + std::string(format) + ": " + one_line(error));
  return bytes;
}

std::string encode_as_png(const Image& image, const Tone& tone) {
  const ImageSpec spec{.width = static_cast<int>(image.width),
                       .height = static_cast<int>(image.height),
                       .channels = {"R", "G", "B"},
                       .texts = {}};
  const std::size_t row = std::size_t{image.width} * 3;
  const std::span<const float> all = image.rgb;
  return write_png(spec, [&](int begin, int end, void* out) {
    encode_row(
        all.subspan(static_cast<std::size_t>(begin) * row, static_cast<std::size_t>(end - begin) * row), tone,
        static_cast<std::uint8_t*>(out));
  });
}

}  // namespace

std::optional<PictureFormat> picture_format_of(const std::filesystem::path& file) {
  std::string ending = file.extension().string();
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  if (ending == ".png") return PictureFormat::png;
  if (ending == ".jpg" || ending == ".jpeg") return PictureFormat::jpeg;
  if (ending == ".tif" || ending == ".tiff") return PictureFormat::tiff;
  return std::nullopt;
}

Result<ValueRange> whole_range(const Image& image) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const float value : image.rgb) {
    if (!std::isfinite(value)) continue;
    low = std::min(low, double{value});
    high = std::max(high, double{value});
  }
  if (!(low <= high)) return input_error("no value is finite").with_mend("there is nothing to show");
  // A sum of unit vectors that was rounded may be a little longer.
  constexpr double unit = 1 + 1e-5;
  if (image.letters == "XYZ" && low >= -unit && high <= unit) return ValueRange{-1, 1};
  if (low == high) return ValueRange{low, low + std::max(std::abs(low), 1.0)};
  return ValueRange{low, high};
}

Result<std::string> encode_picture(const Image& image, PictureFormat format, const Tone& tone) {
  CANDELA_TRY(check_extent(image.width, image.height));
  const std::size_t pixels = std::size_t{image.width} * image.height;
  if (image.rgb.size() != pixels * 3)
    return internal_error("the image to encode has another size than it says");
  if (!(std::abs(tone.exposure_stops) <= 1000)) {
    return usage_error("the exposure is not a number of stops between -1000 and 1000").with_field("exposure");
  }
  if (tone.range && !(tone.range->low < tone.range->high))
    return usage_error("the range to show is empty").with_field("range");
  try {
    switch (format) {
      case PictureFormat::png:
        return encode_as_png(image, tone);
      case PictureFormat::jpeg:
        return encode_by_module<std::uint8_t>(image, "jpeg", SampleType::uint8, tone);
      case PictureFormat::tiff:
        return encode_by_module<std::uint16_t>(image, "tiff", SampleType::uint16, tone);
    }
  } catch (const std::bad_alloc&) {
    return resource_error("the image to encode does not fit into memory");
  } catch (const std::exception& problem) {
    return failed_error("cannot encode the image: " + one_line(problem.what()));
  }
  return internal_error("this is no format of pictures");
}

Result<std::string> encode_png(const Image& image, double exposure_stops) {
  return encode_picture(image, PictureFormat::png, {.exposure_stops = exposure_stops, .range = {}});
}

}  // namespace candela::image
