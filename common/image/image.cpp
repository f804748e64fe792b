// Images in and out.
#include "common/image/image.h"

#include <algorithm>
#include <cmath>
#include <new>
#include <set>

#include "common/image/formats.h"
#include "common/job/job.h"

namespace candela::image {

namespace {

// Deflate expands at most 1032 times, the other codings of even pictures not much more.
constexpr std::uint64_t kMaxExpansion = 1U << 14;
constexpr std::uint64_t kFreeBytes = 1U << 26;

constexpr std::size_t kMaxAttributeName = 255;  // EXR's limit, for attributes and channels

// The cube root of x in [1/8, 1] by Newton's method: only basic operations, so the same bits on every
// machine.
double cube_root(double x) {
  double y = 0.35 + 0.68 * x;
  for (int i = 0; i < 6; ++i) y = (2 * y + x / (y * y)) / 3;
  return y;
}

// The fifth root of x in [1/32, 1], likewise.
double fifth_root(double x) {
  double y = 0.5 + 0.55 * x;
  for (int i = 0; i < 8; ++i) {
    const double y2 = y * y;
    y = (4 * y + x / (y2 * y2)) / 5;
  }
  return y;
}

// x^(1/n) for positive finite x: x = m 2^(n k), m in [2^-n, 1).
template <class Root>
double root(double x, int n, Root&& of_mantissa) {
  int exponent = 0;
  const double mantissa = std::frexp(x, &exponent);  // [1/2, 1)
  const int k = exponent > 0 ? (exponent + n - 1) / n : exponent / n;
  return std::ldexp(of_mantissa(std::ldexp(mantissa, exponent - n * k)), k);
}

// Names that EXR's own attributes have, and dates, which would tell files of equal renders apart.
bool is_reserved(const std::string& key) {
  static constexpr std::string_view kPrefixes[] = {"openexr:", "oiio:", "png:", "exr:"};
  for (const std::string_view prefix : kPrefixes) {
    if (key.compare(0, prefix.size(), prefix) == 0) return true;
  }
  static constexpr std::string_view kNames[] = {"capDate",
                                                "channels",
                                                "chunkCount",
                                                "compression",
                                                "DateTime",
                                                "dataWindow",
                                                "displayWindow",
                                                "lineOrder",
                                                "name",
                                                "pixelAspectRatio",
                                                "screenWindowCenter",
                                                "screenWindowWidth",
                                                "Software",
                                                "tiles",
                                                "type",
                                                "version",
                                                "view"};
  return std::find(std::begin(kNames), std::end(kNames), key) != std::end(kNames);
}

}  // namespace

Result<void> check_extent(std::uint64_t width, std::uint64_t height) {
  if (width == 0 || height == 0 || width > Limits::max_extent || height > Limits::max_extent ||
      width * height > Limits::max_pixels) {
    return input_error("an image of " + std::to_string(width) + " x " + std::to_string(height) +
                       " pixels is not possible")
        .with_mend("use 1 to " + std::to_string(Limits::max_extent) + " pixels a side and at most " +
                   std::to_string(Limits::max_pixels) + " together");
  }
  return {};
}

bool is_reserved_attribute(const std::string& key) {
  return is_reserved(key);
}

namespace {

// Indices of the channels that are red, green and blue; all the same for luminance. Empty if there is no
// color.
std::vector<int> color_channels(const ImageSpec& spec) {
  const auto find = [&](std::initializer_list<const char*> names) {
    for (const char* wanted : names) {
      const auto at = std::find(spec.channels.begin(), spec.channels.end(), wanted);
      if (at != spec.channels.end()) return static_cast<int>(at - spec.channels.begin());
    }
    return -1;
  };
  const int r = find({"R", "r", "red", "Red"});
  const int g = find({"G", "g", "green", "Green"});
  const int b = find({"B", "b", "blue", "Blue"});
  if (r >= 0 && g >= 0 && b >= 0) return {r, g, b};
  int y = find({"Y", "y", "L", "luminance"});
  if (y < 0 && spec.channels.size() == 1 && spec.alpha_channel < 0 && spec.z_channel < 0) y = 0;
  if (y >= 0) return {y, y, y};
  return {};
}

// The same for the layer of that name; kZeros for a channel that it lacks.
constexpr int kZeros = -1;
// `found`: the letters of the channels, such as "XYZ".
std::vector<int> layer_channels(const ImageSpec& spec, const std::string& layer,
                                std::string_view* found = nullptr) {
  struct Kind {
    std::string_view wanted, letters;
  };
  for (const auto& [wanted, letters] : {Kind{"RGB", "RGB"}, Kind{"XYZ", "XYZ"}, Kind{"UV0", "UV"},
                                        Kind{"ZZZ", "Z"}, Kind{"YYY", "Y"}, Kind{"III", "I"}}) {
    std::vector<int> channels;
    if (found != nullptr) *found = letters;
    for (const char letter : wanted) {
      const auto at = std::find(spec.channels.begin(), spec.channels.end(), layer + '.' + letter);
      if (letter == '0')
        channels.push_back(kZeros);
      else if (at != spec.channels.end())
        channels.push_back(static_cast<int>(at - spec.channels.begin()));
    }
    if (channels.size() == wanted.size()) return channels;
  }
  return {};
}

// The names for which layer_channels() finds something, in the file's order.
std::vector<std::string> layer_names(const ImageSpec& spec) {
  std::vector<std::string> names;
  for (const std::string& channel : spec.channels) {
    if (channel.size() < 3 || channel[channel.size() - 2] != '.') continue;
    std::string layer = channel.substr(0, channel.size() - 2);
    if (std::find(names.begin(), names.end(), layer) == names.end() && !layer_channels(spec, layer).empty())
      names.push_back(std::move(layer));
  }
  return names;
}

Error no_such_layer(const std::string& layer, const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  return usage_error("the image has no layer '" + layer + "'")
      .with_mend(names.empty() ? "it has none at all" : "there is " + list);
}

// `layer`: empty for the image itself.
Result<Image> read_open(ImageReader& input, std::uint64_t file_bytes, const std::string& layer) {
  std::vector<int> channels;
  std::vector<std::string> others;
  Image image;
  int part = 0;
  for (; input.seek_part(part); ++part) {
    channels =
        layer.empty() ? color_channels(input.spec()) : layer_channels(input.spec(), layer, &image.letters);
    if (!channels.empty()) break;
    for (std::string& name : layer_names(input.spec())) others.push_back(std::move(name));
  }
  if (channels.empty()) {
    if (const std::string problem = input.error(); !problem.empty())
      return input_error("cannot read part " + std::to_string(part + 1) +
                         " of the image: " + one_line(problem));
    if (!layer.empty()) return no_such_layer(layer, others);
    return input_error("the image has no R, G and B channels and no luminance")
        .with_mend("name the channels of the color R, G and B");
  }
  const ImageSpec spec = input.spec();
  if (spec.width < 0 || spec.height < 0 || spec.depth > 1 || spec.deep) {
    return input_error("the image is not a flat picture");
  }
  image.width = static_cast<std::uint32_t>(spec.width);
  image.height = static_cast<std::uint32_t>(spec.height);
  CANDELA_TRY(check_extent(image.width, image.height));
  const std::size_t pixels = std::size_t{image.width} * image.height;
  // A few bytes that claim gigabytes are refused before the memory is taken.
  if (pixels * 3 * sizeof(float) > kFreeBytes + file_bytes * kMaxExpansion) {
    return input_error("the image says it has " + std::to_string(image.width) + " x " +
                       std::to_string(image.height) + " pixels, which its " + std::to_string(file_bytes) +
                       " bytes cannot hold")
        .with_mend("the file is damaged or truncated");
  }
  image.rgb.resize(pixels * 3);
  const auto failed = [&] { return input_error("cannot read the pixels: " + one_line(input.error())); };
  if (channels[1] == channels[0] + 1 && channels[2] == channels[0] + 2) {
    if (!input.read_part(part, channels[0], channels[0] + 3, SampleType::float32, image.rgb.data())) {
      return failed();
    }
  } else {
    std::vector<float> plane(pixels);
    for (std::size_t c = 0; c < 3; ++c) {
      if (channels[c] == kZeros) continue;
      if (!input.read_part(part, channels[c], channels[c] + 1, SampleType::float32, plane.data())) {
        return failed();
      }
      for (std::size_t p = 0; p < pixels; ++p) image.rgb[3 * p + c] = plane[p];
    }
  }
  if (!spec.floating) {
    for (float& value : image.rgb) value = srgb_to_linear(value);
  }
  for (const auto& [key, value] : spec.texts)
    if (!is_reserved(key)) image.metadata[key] = value;
  return image;
}

Result<Image> read_part(const std::filesystem::path& path, const std::string& layer);

}  // namespace

float srgb_to_linear(float value) {
  if (!(value > 0.04045F)) return value / 12.92F;
  if (!std::isfinite(value)) return value;
  const double v = (double{value} + 0.055) / 1.055;  // to the power 2.4
  const double square = v * v;
  return static_cast<float>(square * root(square, 5, fifth_root));
}

float linear_to_srgb(float value) {
  if (!(value > 0.0031308F)) return value * 12.92F;
  if (!std::isfinite(value)) return value;
  const double twelfth = root(std::sqrt(std::sqrt(double{value})), 3, cube_root);
  const double square = twelfth * twelfth;
  return static_cast<float>(1.055 * (square * square * twelfth) - 0.055);  // value to the power 5/12
}

Result<Image> read_image(const std::filesystem::path& path) {
  return read_part(path, "");
}

Result<Image> decode_exr(std::string_view bytes) {
  CANDELA_ASSIGN(const auto input, open_bytes(bytes, "openexr", "memory.exr", false));
  try {
    return read_open(*input, bytes.size(), "");
  } catch (const std::bad_alloc&) {
    return resource_error("the image does not fit into memory");
  } catch (const std::exception& problem) {  // of the format libraries
    return input_error("cannot read the image: " + one_line(problem.what()));
  }
}

Result<Image> read_layer(const std::filesystem::path& path, const std::string& layer) {
  if (layer.empty()) return usage_error("no layer is named").at(path.string(), 0);
  return read_part(path, layer);
}

namespace {

Result<Image> read_part(const std::filesystem::path& path, const std::string& layer) {
  const std::string name = path.string();
  CANDELA_ASSIGN(const auto input, open_file(path));
  try {
    auto image = read_open(*input, std::filesystem::file_size(path), layer);
    if (!image.ok()) return Error(image.error()).at(name, 0);
    return image;
  } catch (const std::bad_alloc&) {
    return resource_error("the image does not fit into memory").at(name, 0);
  } catch (const std::exception& problem) {  // of the format libraries
    return input_error("cannot read the image: " + one_line(problem.what())).at(name, 0);
  }
}

}  // namespace

Result<ImageSize> read_image_size(const std::filesystem::path& path) {
  CANDELA_ASSIGN(const auto input, open_file(path));
  const ImageSpec& spec = input->spec();
  return ImageSize{static_cast<std::uint32_t>(spec.width), static_cast<std::uint32_t>(spec.height),
                   static_cast<std::uint32_t>(spec.channels.size()), 8 * spec.sample_bytes};
}

Result<std::string> encode_exr(std::uint32_t width, std::uint32_t height, std::span<const float> rgb,
                               const std::map<std::string, std::string>& metadata,
                               std::span<const Layer> layers) {
  CANDELA_TRY(check_extent(width, height));
  const std::size_t pixels = std::size_t{width} * height;
  if (rgb.size() != pixels * 3) return internal_error("the image to encode has another size than it says");
  ImageSpec spec{.width = static_cast<int>(width),
                 .height = static_cast<int>(height),
                 .channels = {"R", "G", "B"},
                 .texts = {}};
  std::set<std::string> names;
  for (const Layer& layer : layers) {
    if (layer.name.empty() || layer.name.size() + 2 > kMaxAttributeName || !names.insert(layer.name).second ||
        layer.name.find('\0') != std::string::npos) {
      return internal_error("'" + layer.name + "' cannot name a layer, or names two").with_field("layer");
    }
    if (layer.row == nullptr && layer.rgb.size() != pixels * layer.letters.size()) {
      return internal_error("the layer '" + layer.name + "' has another size than the image")
          .with_field("layer");
    }
    for (const char letter : layer.letters) spec.channels.push_back(layer.name + '.' + letter);
  }
  if (std::set<std::string_view>(spec.channels.begin(), spec.channels.end()).size() != spec.channels.size())
    return usage_error("two channels of the image have one name").with_field("layer");
  for (const auto& [key, value] : metadata) {
    if (key.empty() || key.size() > kMaxAttributeName || key.find('\0') != std::string::npos ||
        is_reserved(key)) {
      return input_error("'" + key + "' cannot name an attribute of an image")
          .with_field(key)
          .with_mend("begin its name with 'candela:'");
    }
    spec.texts.emplace_back(key, value);
  }
  try {
    const std::size_t channels = spec.channels.size();
    std::vector<float> layer_row;
    return write_exr(spec, [&](int begin, int end, void* out) {
      auto* row = static_cast<float*>(out);
      for (auto y = static_cast<std::uint32_t>(begin); y < static_cast<std::uint32_t>(end); ++y) {
        const auto put = [&](const float* from, std::size_t count, std::size_t first) {
          for (std::size_t x = 0; x < width; ++x)
            std::copy_n(from + count * x, count, row + x * channels + first);
        };
        const std::size_t row_pixels = std::size_t{y} * width;
        put(&rgb[row_pixels * 3], 3, 0);
        std::size_t first = 3;
        for (const Layer& layer : layers) {
          const std::size_t count = layer.letters.size();
          if (layer.row) {
            layer_row.resize(width * count);
            layer.row(y, layer_row);
          }
          put(layer.row ? layer_row.data() : &layer.rgb[row_pixels * count], count, first);
          first += count;
        }
        row += width * channels;
      }
    });
  } catch (const std::bad_alloc&) {
    return resource_error("the image to encode does not fit into memory");
  } catch (const std::exception& problem) {
    return failed_error("cannot encode the image as OpenEXR: " + one_line(problem.what()));
  }
}

}  // namespace candela::image
