#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>

#include <algorithm>
#include <cstring>
#include <vector>

#include "common/image/exr.h"
#include "common/image/formats.h"

namespace candela::image {
namespace {

// The rows of a band at a time, so that an image of many layers need not be interleaved as a whole. A
// multiple of the 16 rows that zip compresses together.
constexpr int kBandRows = 64;

class TextStream final : public Imf::OStream {
 public:
  explicit TextStream(std::string& bytes) : OStream("memory.exr"), bytes_(bytes) {}
  void write(const char from[], int count) override {
    const auto size = static_cast<std::size_t>(count);
    if (at_ + size > bytes_.size()) bytes_.resize(at_ + size);
    std::memcpy(bytes_.data() + at_, from, size);
    at_ += size;
  }
  std::uint64_t tellp() override { return at_; }
  void seekp(std::uint64_t at) override { at_ = at; }

 private:
  std::string& bytes_;
  std::uint64_t at_ = 0;
};

}  // namespace

std::string write_exr(const ImageSpec& spec, const RowSource& rows) {
  Imf::Header header(spec.width, spec.height);
  header.compression() = Imf::ZIP_COMPRESSION;
  for (const std::string& name : spec.channels) header.channels().insert(name, Imf::Channel(Imf::FLOAT));
  for (const auto& [key, value] : spec.texts) header.insert(key, Imf::StringAttribute(value));

  const std::size_t count = spec.channels.size();
  const std::size_t row = count * static_cast<std::size_t>(spec.width);
  std::string bytes;
  {
    TextStream stream(bytes);
    Imf::OutputFile file(stream, header,
                         exr_threads(row * static_cast<std::size_t>(spec.height) * sizeof(float)));
    std::vector<float> band(row * static_cast<std::size_t>(std::min(kBandRows, spec.height)));
    for (int begin = 0; begin < spec.height; begin += kBandRows) {
      const int end = std::min(begin + kBandRows, spec.height);
      rows(begin, end, band.data());
      Imf::FrameBuffer buffer;
      for (std::size_t c = 0; c < count; ++c) {
        buffer.insert(spec.channels[c],
                      Imf::Slice::Make(Imf::FLOAT, band.data() + c, Imath::V2i(0, begin), spec.width,
                                       end - begin, count * sizeof(float), row * sizeof(float)));
      }
      file.setFrameBuffer(buffer);
      file.writePixels(end - begin);
    }
  }  // the file's end writes its table of chunks
  return bytes;
}

}  // namespace candela::image
