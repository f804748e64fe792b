// A look at an OpenEXR header before the library makes room for what it says.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <string>

#include "common/image/exr.h"

namespace candela::image {
namespace {

constexpr std::uint32_t kTiled = 0x200, kSeveralParts = 0x1000;  // in the version's flags
constexpr std::size_t kMaxName = 255;
constexpr std::uint64_t kEntryBytes = 8;                 // of a table of chunks
constexpr std::uint64_t kMany = std::uint64_t{1} << 31;  // chunks along a side, beyond which files do not go

class HeaderWalk {
 public:
  explicit HeaderWalk(ByteSource& source) : source_(source) {}
  std::string error();

 private:
  template <class T>
  bool get(T& value) {
    if (!source_.read(at_, sizeof value, &value)) return false;
    at_ += sizeof value;
    return true;
  }
  // A text of `text` and its zero; false if it is longer than any name.
  bool get_name(std::string& text);
  bool read_attribute(const std::string& name);
  // Minimum number of chunks of the part that ends here.
  std::uint64_t chunks() const;

  ByteSource& source_;
  std::uint64_t at_ = 0;
  std::uint32_t flags_ = 0;
  // The data window of the part.
  std::array<std::int32_t, 4> window_{};
  std::array<std::uint32_t, 2> tile_{};  // 0: not said
  std::uint8_t compression_ = 0;
  std::string type_;
};

bool HeaderWalk::get_name(std::string& text) {
  text.clear();
  for (char c = 0; get(c);) {
    if (c == 0) return true;
    if (text.size() == kMaxName) return false;
    text.push_back(c);
  }
  return false;
}

bool HeaderWalk::read_attribute(const std::string& name) {
  std::string type;
  std::uint32_t size = 0;
  if (!get_name(type) || !get(size) || size > source_.size() - at_) return false;
  const std::uint64_t end = at_ + size;
  if (name == "dataWindow" && size == sizeof window_) {
    if (!get(window_)) return false;
  } else if (name == "tiles" && size >= sizeof tile_) {
    if (!get(tile_)) return false;
  } else if (name == "compression" && size == 1) {
    if (!get(compression_)) return false;
  } else if (name == "type" && size <= kMaxName) {
    type_.resize(size);
    if (!source_.read(at_, size, type_.data())) return false;
  }
  at_ = end;
  return true;
}

std::uint64_t HeaderWalk::chunks() const {
  const std::int64_t width = std::int64_t{window_[2]} - window_[0] + 1;
  const std::int64_t height = std::int64_t{window_[3]} - window_[1] + 1;
  if (width < 1 || height < 1) return 0;
  const auto parts = [](std::int64_t length, std::uint64_t part) {
    return std::min(kMany, (static_cast<std::uint64_t>(length) + part - 1) / part);
  };
  const bool tiled = type_.empty() ? (flags_ & kTiled) != 0 : type_.find("tile") != std::string::npos;
  if (tiled) return tile_[0] == 0 || tile_[1] == 0 ? 0 : parts(width, tile_[0]) * parts(height, tile_[1]);
  // Rows of a chunk: none, rle, zips, zip, piz, pxr24, b44, b44a, dwaa, dwab.
  constexpr std::array<std::uint64_t, 10> kRows{1, 1, 1, 16, 32, 16, 32, 32, 32, 256};
  return parts(height, compression_ < kRows.size() ? kRows[compression_] : kRows.back());
}

std::string HeaderWalk::error() {
  const std::string damaged = "the file's header is damaged or cut off";
  std::uint32_t magic = 0;
  if (!get(magic) || !get(flags_)) return damaged;
  std::uint64_t chunks_of_all = 0;
  std::string name;
  for (bool first = true;;) {
    if (!get_name(name)) return damaged;
    if (!name.empty()) {
      if (!read_attribute(name)) return damaged;
      first = false;
      continue;
    }
    // The part's end; in a file of several, an empty part ends the last.
    const bool several = (flags_ & kSeveralParts) != 0;
    if (!first) {
      const std::uint64_t most = (source_.size() - at_) / kEntryBytes;
      const std::uint64_t here = chunks();
      if (here > most || chunks_of_all > most - here)
        return "the file is too short for the size that its header says";
      chunks_of_all += here;
    }
    if (!several || first) return {};
    first = true;
    window_ = {};
    tile_ = {};
    compression_ = 0;
    type_.clear();
  }
}

}  // namespace

std::string exr_header_error(ByteSource& source) {
  return HeaderWalk(source).error();
}

}  // namespace candela::image
