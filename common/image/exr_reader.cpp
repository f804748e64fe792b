#include <ImfBoxAttribute.h>
#include <ImfChannelList.h>
#include <ImfChromaticitiesAttribute.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputPart.h>
#include <ImfIntAttribute.h>
#include <ImfMultiPartInputFile.h>
#include <ImfPartType.h>
#include <ImfStandardAttributes.h>
#include <ImfStringAttribute.h>
#include <ImfThreading.h>
#include <OpenEXRConfig.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <mutex>
#include <optional>
#include <set>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <tuple>

#include "common/image/exr.h"

namespace candela::image {
namespace {

constexpr std::uint64_t kManyBytes = 4 << 20;       // of an image that threads decode or encode
constexpr std::uint64_t kFreeTileBytes = 64 << 20;  // of a row of tiles, however small the image is

class SourceStream final : public Imf::IStream {
 public:
  SourceStream(std::unique_ptr<ByteSource> source, const std::string& name)
      : IStream(name.c_str()), source_(std::move(source)) {}
  bool read(char out[], int count) override {
    if (count < 0 || !source_->read(at_, static_cast<std::size_t>(count), out))
      throw std::runtime_error("the file ends too early");
    at_ += static_cast<std::uint64_t>(count);
    return at_ < source_->size();
  }
  std::uint64_t tellg() override { return at_; }
  void seekg(std::uint64_t at) override { at_ = at; }
  std::uint64_t size() const { return source_->size(); }

 private:
  std::unique_ptr<ByteSource> source_;
  std::uint64_t at_ = 0;
};

struct FileChannel {
  std::string name, layer;
  int rank = 0;  // in the layer
  Imf::PixelType type = Imf::HALF;
};

std::string_view layer_of(std::string_view name) {
  const std::size_t point = name.rfind('.');
  return point == std::string_view::npos ? std::string_view() : name.substr(0, point);
}

std::string_view letter_of(std::string_view name) {
  return name.substr(name.rfind('.') + 1);
}

bool is_one_of(std::string_view name, std::initializer_list<std::string_view> lower_case) {
  return std::any_of(lower_case.begin(), lower_case.end(), [&](std::string_view each) {
    return std::equal(name.begin(), name.end(), each.begin(), each.end(),
                      [](char a, char b) { return (a >= 'A' && a <= 'Z' ? a - 'A' + 'a' : a) == b; });
  });
}

bool is_alpha(std::string_view name) {
  return is_one_of(name, {"a", "alpha"});
}

bool is_depth(std::string_view name) {
  return is_one_of(name, {"z", "depth"});
}

// Place of a channel in its layer: colors first, so that they can be read together, in the order that
// people write. Without an X, Z is a depth.
int rank_of(std::string_view letter, bool has_x) {
  const std::initializer_list<std::string_view> colors[] = {
      {"r", "red"}, {"g", "green"}, {"b", "blue"}, {"x"}, {"y"}, {has_x ? "z" : "y"}};
  int rank = 0;
  for (const auto& names : colors) {
    if (is_one_of(letter, names)) return rank;
    ++rank;
  }
  if (is_alpha(letter)) return rank;
  return is_depth(letter) ? rank + 1 : rank + 2;
}

// The image's own channels first, then those of each layer.
std::vector<FileChannel> channels_of(const Imf::Header& header) {
  std::set<std::string> with_x;  // layers
  for (auto c = header.channels().begin(); c != header.channels().end(); ++c)
    if (is_one_of(letter_of(c.name()), {"x"})) with_x.emplace(layer_of(c.name()));
  std::vector<FileChannel> channels;
  for (auto c = header.channels().begin(); c != header.channels().end(); ++c) {
    std::string layer(layer_of(c.name()));
    const int rank = rank_of(letter_of(c.name()), with_x.contains(layer));
    channels.push_back({c.name(), std::move(layer), rank, c.channel().type});
  }
  std::stable_sort(channels.begin(), channels.end(), [](const FileChannel& a, const FileChannel& b) {
    return std::tie(a.layer, a.rank) < std::tie(b.layer, b.rank);
  });
  return channels;
}

// Empty, or why the part cannot be read.
std::string part_error(const Imf::Header& header) {
  for (auto c = header.channels().begin(); c != header.channels().end(); ++c) {
    const Imf::Channel& channel = c.channel();
    if (channel.xSampling != 1 || channel.ySampling != 1)
      return std::string("the channel '") + c.name() + "' has fewer pixels than the image (" +
             std::to_string(channel.xSampling) + " x " + std::to_string(channel.ySampling) +
             " of the image for one), as luminance and chroma have; save the image as R, G and B";
  }
  return {};
}

std::array<float, 8> numbers_of(const Imf::Chromaticities& c) {
  return {c.red.x, c.red.y, c.green.x, c.green.y, c.blue.x, c.blue.y, c.white.x, c.white.y};
}

ImageSpec spec_of(const Imf::Header& header, const std::vector<FileChannel>& channels) {
  const Imath::Box2i& data = header.dataWindow();
  const Imath::Box2i& display = header.displayWindow();
  ImageSpec spec{.x = data.min.x,
                 .y = data.min.y,
                 .width = data.max.x - data.min.x + 1,
                 .height = data.max.y - data.min.y + 1,
                 .channels = {},
                 .display_x = display.min.x,
                 .display_y = display.min.y,
                 .display_width = display.max.x - display.min.x + 1,
                 .display_height = display.max.y - display.min.y + 1,
                 .part = header.hasName() ? header.name() : "",
                 .texts = {}};
  std::uint64_t pixel_bytes = 0;
  for (std::size_t i = 0; i < channels.size(); ++i) {
    spec.channels.push_back(channels[i].name);
    const std::uint32_t bytes = channels[i].type == Imf::HALF ? 2 : 4;
    spec.sample_bytes = std::max(spec.sample_bytes, bytes);
    pixel_bytes += bytes;
    spec.floating = spec.floating || channels[i].type != Imf::UINT;
    if (spec.alpha_channel < 0 && is_alpha(letter_of(channels[i].name)))
      spec.alpha_channel = static_cast<int>(i);
    if (spec.z_channel < 0 && is_depth(letter_of(channels[i].name))) spec.z_channel = static_cast<int>(i);
  }
  spec.image_bytes =
      pixel_bytes * static_cast<std::uint64_t>(spec.width) * static_cast<std::uint64_t>(spec.height);
  const std::string type = header.hasType() ? header.type() : "";
  spec.deep = type == Imf::DEEPSCANLINE || type == Imf::DEEPTILE;
  if (header.hasTileDescription() && (type.empty() || type == Imf::TILEDIMAGE || type == Imf::DEEPTILE)) {
    constexpr unsigned kMax = std::numeric_limits<int>::max();
    spec.tile_width = static_cast<int>(std::min(header.tileDescription().xSize, kMax));
    spec.tile_height = static_cast<int>(std::min(header.tileDescription().ySize, kMax));
  }
  if (Imf::hasChromaticities(header)) spec.chromaticities = numbers_of(Imf::chromaticities(header));
  if (const auto* orientation = header.findTypedAttribute<Imf::IntAttribute>("Orientation"))
    spec.orientation = orientation->value();
  for (auto a = header.begin(); a != header.end(); ++a) {
    if (const auto* text = dynamic_cast<const Imf::StringAttribute*>(&a.attribute()))
      spec.texts.emplace_back(a.name(), text->value());
  }
  return spec;
}

class ExrReader final : public ImageReader {
 public:
  ExrReader(std::unique_ptr<ByteSource> source, const std::string& name)
      : stream_(std::move(source), name), file_(stream_, exr_threads(stream_.size())) {}

  const ImageSpec& spec() const override { return spec_; }

  bool seek_part(int part) override {
    if (part < 0 || part >= file_.parts()) return false;
    const Imf::Header& header = file_.header(part);
    error_ = part_error(header);
    if (!error_.empty()) return false;
    if (part != part_) input_.reset();
    part_ = part;
    channels_ = channels_of(header);
    spec_ = spec_of(header, channels_);
    return true;
  }

  bool read_part(int part, int first, int last, SampleType type, void* out) override {
    return (part == part_ || seek_part(part)) && read_rows(0, spec_.height, first, last, type, out);
  }
  bool read_rows(int begin, int end, int first, int last, SampleType type, void* out) override {
    if (type != SampleType::float32) return fail("OpenEXR images are read as floats");
    if (begin < 0 || begin >= end || end > spec_.height || first < 0 || first >= last ||
        last > static_cast<int>(channels_.size()))
      return fail("there are no such rows and channels");
    if (!tiles_fit()) return fail("the tiles are much larger than the image");
    if (spec_.deep) return fail("a pixel of a deep image has a list of samples");
    try {
      read(begin, end, static_cast<std::size_t>(first), static_cast<std::size_t>(last),
           static_cast<float*>(out));
    } catch (const std::exception& problem) {
      return fail(problem.what());
    }
    return true;
  }
  bool read_tiles(int begin, int end, int first, int last, SampleType type, void* out) override {
    return read_rows(begin, end, first, last, type, out);
  }
  std::string error() override { return std::exchange(error_, {}); }

 private:
  bool fail(const char* why) {
    error_ = why;
    return false;
  }

  // OpenEXR makes room for a row of whole tiles, whatever they cover of the image.
  bool tiles_fit() const {
    if (spec_.tile_height <= 0) return true;
    const auto width = static_cast<std::uint64_t>(spec_.width);
    const std::uint64_t pixel = spec_.image_bytes / (width * static_cast<std::uint64_t>(spec_.height));
    const std::uint64_t across = std::max(width, static_cast<std::uint64_t>(spec_.tile_width));
    return across <= std::max(spec_.image_bytes, kFreeTileBytes) / pixel /
                         static_cast<std::uint64_t>(spec_.tile_height);
  }

  void read(int begin, int end, std::size_t first, std::size_t last, float* out) {
    // Not before somebody wants pixels: it makes room for rows or tiles of the size that the header says.
    if (!input_) input_.emplace(file_, part_);
    const std::size_t count = last - first;
    const std::size_t row = count * static_cast<std::size_t>(spec_.width);
    const Imath::V2i origin(spec_.x, spec_.y + begin);
    Imf::FrameBuffer buffer;
    for (std::size_t c = first; c < last; ++c) {
      // Integers come as they are, in the place of the floats that they become.
      const Imf::PixelType type = channels_[c].type == Imf::UINT ? Imf::UINT : Imf::FLOAT;
      buffer.insert(channels_[c].name, Imf::Slice::Make(type, out + (c - first), origin, spec_.width,
                                                        end - begin, count * sizeof *out, row * sizeof *out));
    }
    input_->setFrameBuffer(buffer);
    input_->readPixels(spec_.y + begin, spec_.y + end - 1);
    for (std::size_t c = first; c < last; ++c) {
      if (channels_[c].type != Imf::UINT) continue;
      const std::size_t samples = row * static_cast<std::size_t>(end - begin);
      for (std::size_t i = c - first; i < samples; i += count) {
        std::uint32_t value = 0;
        std::memcpy(&value, out + i, sizeof value);
        out[i] = static_cast<float>(value) * 0x1p-32F;
      }
    }
  }

  SourceStream stream_;
  Imf::MultiPartInputFile file_;
  std::optional<Imf::InputPart> input_;  // of part_
  int part_ = -1;
  std::vector<FileChannel> channels_;
  ImageSpec spec_;
  std::string error_;
};

}  // namespace

std::unique_ptr<ImageReader> open_exr(std::unique_ptr<ByteSource> source, const std::string& name,
                                      std::string& error) {
  error = exr_header_error(*source);
  if (!error.empty()) return nullptr;
  auto reader = std::make_unique<ExrReader>(std::move(source), name);
  if (reader->seek_part(0)) return reader;
  error = reader->error();
  return nullptr;
}

int exr_threads(std::uint64_t bytes) {
  if (bytes < kManyBytes) return 0;
  static std::once_flag once;
  std::call_once(once,
                 [] { Imf::setGlobalThreadCount(static_cast<int>(std::thread::hardware_concurrency())); });
  return Imf::globalThreadCount();
}

std::string exr_library() {
  return "OpenEXR " OPENEXR_VERSION_STRING;
}

}  // namespace candela::image
