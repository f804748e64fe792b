// The module of image files of other formats than OpenEXR, PNG and JPEG, and of JPEG to write, by
// OpenImageIO. Its types stay inside this file.
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <string>

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
                 .display_x = from.full_x,
                 .display_y = from.full_y,
                 .display_width = from.full_width,
                 .display_height = from.full_height,
                 .part = std::string(from.get_string_attribute("oiio:subimagename")),
                 .orientation = from.get_int_attribute("Orientation", 1),
                 .texts = {}};
  if (const auto* primaries = from.find_attribute("chromaticities", OIIO::TypeDesc(OIIO::TypeDesc::FLOAT, 8)))
    std::memcpy(spec.chromaticities.emplace().data(), primaries->data(), sizeof(float) * 8);
  // A format may count channels without naming them.
  spec.channels.resize(static_cast<std::size_t>(std::max(0, from.nchannels)));
  for (const OIIO::ParamValue& attribute : from.extra_attribs)
    if (attribute.type() == OIIO::TypeDesc::STRING)
      spec.texts.emplace_back(attribute.name().string(), attribute.get_string());
  return spec;
}

// The encoded bytes as the library reads them. Its own reader copies from before them where a damaged file
// asks for a negative place.
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
    if (!input_->seek_subimage(part, 0)) {
      (void)input_->geterror();  // that there are no more is none
      return false;
    }
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

// A file without a place on a disk, by a name that any library can open. (OpenImageIO 2.4 writes damaged
// TIFFs into its own buffers in memory.)
class MemoryFile {
 public:
  MemoryFile() : descriptor_(memfd_create("candela-image", MFD_CLOEXEC)) {}
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  ~MemoryFile() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  bool there() const { return descriptor_ >= 0; }
  std::string name() const { return "/proc/self/fd/" + std::to_string(descriptor_); }
  // Empty if the file cannot be read.
  std::string bytes() const {
    const off_t size = lseek(descriptor_, 0, SEEK_END);
    std::string out(size > 0 ? static_cast<std::size_t>(size) : 0, '\0');
    for (std::size_t at = 0; at < out.size();) {
      const ssize_t count = pread(descriptor_, out.data() + at, out.size() - at, static_cast<off_t>(at));
      if (count <= 0) return {};
      at += static_cast<std::size_t>(count);
    }
    return out;
  }

 private:
  int descriptor_;
};

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

  std::string encode(const char* format, int width, int height, SampleType type, const void* pixels,
                     int quality, std::string& error) const override {
    const auto output = OIIO::ImageOutput::create(format);
    const MemoryFile file;
    if (!output || !file.there()) {
      error = output ? "there is no room for it in memory" : OIIO::geterror();
      return {};
    }
    OIIO::ImageSpec spec(width, height, 3, type_of(type));
    spec.attribute("oiio:ColorSpace", "sRGB");
    spec.attribute("compression",
                   std::string(format) == "jpeg" ? "jpeg:" + std::to_string(quality) : std::string("zip"));
    if (!output->open(file.name(), spec) || !output->write_image(type_of(type), pixels) || !output->close()) {
      error = output->geterror();
      return {};
    }
    std::string bytes = file.bytes();
    if (bytes.empty()) error = "the file that was written cannot be read";
    return bytes;
  }
};

}  // namespace
}  // namespace candela::image

extern "C" const candela::image::ImageCodec* candela_image_codec_3() {
  static const candela::image::Codec codec;
  return &codec;
}
