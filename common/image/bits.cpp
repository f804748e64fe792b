#include "common/image/bits.h"

#include <algorithm>
#include <cstring>
#include <memory>

#include "common/image/formats.h"
#include "common/image/image.h"

namespace candela::image {
namespace {

constexpr int kBandRows = 64;

// The values of an open file, band by band.
class Bands {
 public:
  explicit Bands(ImageReader& reader)
      : reader_(reader), count_(static_cast<int>(reader.spec().channels.size())) {}
  bool read(int begin, int end) {
    values_.resize(static_cast<std::size_t>(end - begin) * static_cast<std::size_t>(reader_.spec().width) *
                   static_cast<std::size_t>(count_));
    return reader_.read_rows(begin, end, 0, count_, SampleType::float32, values_.data());
  }
  const float* at(std::size_t pixel, int channel) const {
    return values_.data() + pixel * static_cast<std::size_t>(count_) + static_cast<std::size_t>(channel);
  }

 private:
  ImageReader& reader_;
  int count_;
  std::vector<float> values_;
};

Error cannot_read(const std::filesystem::path& path, ImageReader& reader) {
  return input_error("the pixels cannot be read: " + one_line(reader.error())).at(path.string(), 0);
}

std::map<std::string, std::string> texts_of(ImageReader& reader) {
  const auto& texts = reader.spec().texts;
  return {texts.begin(), texts.end()};
}

}  // namespace

Result<std::map<std::string, std::string>> read_texts(const std::filesystem::path& path) {
  CANDELA_ASSIGN(const std::unique_ptr<ImageReader> reader, open_file(path));
  return texts_of(*reader);
}

Result<std::map<std::string, std::string>> texts_of(std::string_view exr) {
  CANDELA_ASSIGN(const std::unique_ptr<ImageReader> reader, open_bytes(exr, "openexr", "memory.exr", false));
  return texts_of(*reader);
}

Result<BitComparison> compare_bits(const std::filesystem::path& a, const std::filesystem::path& b) {
  CANDELA_TRY(read_image_size(a));  // of a size that an image may have
  CANDELA_TRY(read_image_size(b));
  CANDELA_ASSIGN(const std::unique_ptr<ImageReader> first, open_file(a));
  CANDELA_ASSIGN(const std::unique_ptr<ImageReader> second, open_file(b));
  const ImageSpec &s = first->spec(), &t = second->spec();
  if (s.width != t.width || s.height != t.height)
    return input_error(std::to_string(t.width) + "x" + std::to_string(t.height) + " pixels, and " +
                       a.string() + " has " + std::to_string(s.width) + "x" + std::to_string(s.height))
        .at(b.string(), 0);
  struct Pair {
    std::string name;
    int first, second;
    bool equal = true;
  };
  BitComparison out;
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i < s.channels.size(); ++i) {
    const auto found = std::find(t.channels.begin(), t.channels.end(), s.channels[i]);
    if (found == t.channels.end())
      out.missing.push_back(s.channels[i]);
    else
      pairs.push_back({s.channels[i], static_cast<int>(i), static_cast<int>(found - t.channels.begin())});
  }
  Bands one(*first), other(*second);
  for (int begin = 0; begin < s.height; begin += kBandRows) {
    const int end = std::min(begin + kBandRows, s.height);
    if (!one.read(begin, end)) return cannot_read(a, *first);
    if (!other.read(begin, end)) return cannot_read(b, *second);
    const auto pixels = static_cast<std::size_t>(end - begin) * static_cast<std::size_t>(s.width);
    for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
      bool differs = false;
      for (Pair& pair : pairs) {
        if (std::memcmp(one.at(pixel, pair.first), other.at(pixel, pair.second), sizeof(float)) == 0)
          continue;
        differs = true;
        pair.equal = false;
      }
      out.differing_pixels += differs ? 1 : 0;
    }
    out.pixels += pixels;
  }
  for (Pair& pair : pairs) (pair.equal ? out.equal : out.differing).push_back(std::move(pair.name));
  return out;
}

}  // namespace candela::image
