// The module of image files, by OpenImageIO. Its types stay inside this file.
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "common/image/codec.h"

namespace candela::image {
namespace {

OIIO::TypeDesc type_of(SampleType type) {
  switch (type) {
    case SampleType::uint8:
      return OIIO::TypeDesc::UINT8;
    case SampleType::uint16:
      return OIIO::TypeDesc::UINT16;
    case SampleType::float32:
      break;
  }
  return OIIO::TypeDesc::FLOAT;
}

ImageSpec spec_of(const OIIO::ImageSpec& from) {
  ImageSpec spec{.x = from.x,
                 .y = from.y,
                 .z = from.z,
                 .width = from.width,
                 .height = from.height,
                 .depth = from.depth,
                 .tile_width = from.tile_width,
                 .tile_height = from.tile_height,
                 .channels = from.channelnames,
                 .alpha_channel = from.alpha_channel,
                 .z_channel = from.z_channel,
                 .floating = from.format.is_floating_point(),
                 .is_uint8 = from.format == OIIO::TypeDesc::UINT8,
                 .sample_bytes = static_cast<std::uint32_t>(from.format.basesize()),
                 .image_bytes = from.image_bytes(true),
                 .deep = from.deep,
                 .texts = {}};
  // A format may count channels without naming them.
  spec.channels.resize(static_cast<std::size_t>(std::max(0, from.nchannels)));
  for (const OIIO::ParamValue& attribute : from.extra_attribs)
    if (attribute.type() == OIIO::TypeDesc::STRING)
      spec.texts.emplace_back(attribute.name().string(), attribute.get_string());
  return spec;
}

// The encoded bytes as the library reads them. Its own reader copies from before them where a damaged file
// (an OpenEXR table of offsets, say) asks for a negative place.
class BytesReader final : public OIIO::Filesystem::IOMemReader {
 public:
  explicit BytesReader(std::string_view bytes) : IOMemReader(bytes.data(), bytes.size()) {}
  std::size_t pread(void* out, std::size_t size, std::int64_t offset) override {
    const auto end = static_cast<std::size_t>(m_buf.size());
    if (offset < 0 || static_cast<std::size_t>(offset) >= end) return 0;
    const auto at = static_cast<std::size_t>(offset);
    size = std::min(size, end - at);
    std::memcpy(out, m_buf.data() + at, size);
    return size;
  }
  std::size_t read(void* out, std::size_t size) override {
    size = pread(out, size, m_pos);
    m_pos += static_cast<std::int64_t>(size);
    return size;
  }
};

class Reader final : public ImageReader {
 public:
  Reader(std::unique_ptr<BytesReader> bytes, std::unique_ptr<OIIO::ImageInput> input)
      : bytes_(std::move(bytes)), input_(std::move(input)), spec_(spec_of(input_->spec())) {}
  const ImageSpec& spec() const override { return spec_; }
  bool seek_part(int part) override {
    if (!input_->seek_subimage(part, 0)) return false;
    spec_ = spec_of(input_->spec());
    return true;
  }
  bool read_part(int part, int first, int last, SampleType type, void* out) override {
    return input_->read_image(part, 0, first, last, type_of(type), out);
  }
  bool read_rows(int begin, int end, int first, int last, SampleType type, void* out) override {
    return input_->read_scanlines(0, 0, spec_.y + begin, spec_.y + end, spec_.z, first, last, type_of(type),
                                  out);
  }
  bool read_tiles(int begin, int end, int first, int last, SampleType type, void* out) override {
    return input_->read_tiles(0, 0, spec_.x, spec_.x + spec_.width, spec_.y + begin, spec_.y + end, spec_.z,
                              spec_.z + 1, first, last, type_of(type), out);
  }
  std::string error() override { return input_->geterror(); }

 private:
  // In this order: the input reads the bytes until it is closed.
  std::unique_ptr<BytesReader> bytes_;
  std::unique_ptr<OIIO::ImageInput> input_;
  ImageSpec spec_;
};

// The rows of a band at a time, so that an image of many layers need not be interleaved as a whole. A
// multiple of the 16 rows that EXR's zip compresses together.
constexpr int kBandRows = 64;

class Codec final : public ImageCodec {
 public:
  std::string library() const override { return "OpenImageIO " OIIO_VERSION_STRING; }

  std::unique_ptr<ImageReader> open_file(const std::string& path, std::string& error) const override {
    auto input = OIIO::ImageInput::open(path);
    if (input) return std::make_unique<Reader>(nullptr, std::move(input));
    error = OIIO::geterror();
    return nullptr;
  }

  std::unique_ptr<ImageReader> open_bytes(std::string_view bytes, const char* format, const std::string& name,
                                          bool straight_colors, std::string& error) const override {
    auto input = OIIO::ImageInput::create(format);
    // The bytes are all there is: a reader that would open a file by name instead must not be asked.
    if (!input || !input->supports("ioproxy")) {
      error = std::string("this OpenImageIO cannot decode the format ") + format + " from memory";
      return nullptr;
    }
    auto reader = std::make_unique<BytesReader>(bytes);
    OIIO::ImageSpec config;
    if (straight_colors) config.attribute("oiio:UnassociatedAlpha", 1);
    OIIO::ImageSpec opened;
    if (!input->set_ioproxy(reader.get()) || !input->open(name, opened, config)) {
      error = input->geterror();
      return nullptr;
    }
    return std::make_unique<Reader>(std::move(reader), std::move(input));
  }

  bool write(const char* format, const ImageSpec& from, SampleType type, const RowSource& rows,
             std::string& bytes, std::string& error) const override {
    const auto output = OIIO::ImageOutput::create(format);
    if (!output) {
      error = OIIO::geterror();
      return false;
    }
    const OIIO::TypeDesc samples = type_of(type);
    OIIO::ImageSpec spec(from.width, from.height, static_cast<int>(from.channels.size()), samples);
    spec.channelnames = from.channels;
    for (const auto& [key, value] : from.texts) spec.attribute(key, value);
    OIIO::Filesystem::IOVecOutput memory;
    // The name only tells the format; nothing is written to the disk.
    if (!output->set_ioproxy(&memory) || !output->open(std::string("memory.") + format, spec) ||
        !write_bands(*output, spec, samples, rows) || !output->close()) {
      error = output->geterror();
      return false;
    }
    bytes.assign(memory.buffer().begin(), memory.buffer().end());
    return true;
  }

 private:
  static bool write_bands(OIIO::ImageOutput& output, const OIIO::ImageSpec& spec, OIIO::TypeDesc type,
                          const RowSource& rows) {
    std::vector<unsigned char> band(static_cast<std::size_t>(spec.width) *
                                    static_cast<std::size_t>(spec.nchannels) * type.size() *
                                    static_cast<std::size_t>(std::min(kBandRows, spec.height)));
    for (int begin = 0; begin < spec.height; begin += kBandRows) {
      const int end = std::min(begin + kBandRows, spec.height);
      rows(begin, end, band.data());
      if (!output.write_scanlines(begin, end, 0, type, band.data())) return false;
    }
    return true;
  }
};

}  // namespace
}  // namespace candela::image

extern "C" const candela::image::ImageCodec* candela_image_codec_1() {
  static const candela::image::Codec codec;
  return &codec;
}
