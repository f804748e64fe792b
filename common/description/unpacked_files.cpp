#include "common/description/unpacked_files.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <memory>

#include "common/base/work_monitor.h"

namespace candela::description {
namespace {

constexpr std::size_t max_unpacked_bytes = std::size_t{4} << 30;
constexpr std::size_t step_bytes = std::size_t{1} << 20;
constexpr int gzip_window = 15 + 16;  // zlib's way to ask for a gzip header

class Inflater {
 public:
  Inflater() { ready_ = inflateInit2(&stream_, gzip_window) == Z_OK; }
  ~Inflater() {
    if (ready_) inflateEnd(&stream_);
  }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;
  bool ready() const { return ready_; }
  z_stream& stream() { return stream_; }

 private:
  z_stream stream_{};
  bool ready_ = false;
};

// The first `max_bytes` of the content or more, or all of it if it is shorter.
Result<std::string> unpack(std::string_view bytes, const std::string& key, std::size_t max_bytes,
                           Charge& charge) {
  Inflater inflater;
  if (!inflater.ready()) return resource_error("not enough memory to unpack").at(key, 0);
  z_stream& stream = inflater.stream();
  std::string result;
  int status = Z_OK;
  while (true) {
    work_step();
    if (stream.avail_in == 0) {
      const std::size_t take = std::min<std::size_t>(bytes.size(), step_bytes);
      // zlib does not write through next_in; its type is older than const.
      stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
      stream.avail_in = static_cast<uInt>(take);
      bytes.remove_prefix(take);
    }
    // Several packed parts may follow each other.
    if (status == Z_STREAM_END) {
      if (stream.avail_in == 0) return result;
      if (inflateReset2(&stream, gzip_window) != Z_OK) break;
    }
    const std::size_t before = result.size();
    const std::size_t room = std::min(step_bytes, max_bytes + 1 - before);
    if (before + room > result.capacity()) {
      // Both the old and the new buffer are there while it grows.
      const std::size_t old = before > 0 ? result.capacity() : 0;
      const std::size_t wanted = std::max(before + room, 2 * old);
      CANDELA_TRY(charge.add(wanted, {key, 0}, "the unpacked bytes"));
      result.reserve(wanted);
      charge.give_back(old);
    }
    result.resize(before + room);
    stream.next_out = reinterpret_cast<Bytef*>(result.data() + before);
    stream.avail_out = static_cast<uInt>(room);
    const bool at_end = stream.avail_in == 0;
    status = inflate(&stream, Z_NO_FLUSH);
    result.resize(result.size() - stream.avail_out);
    if (result.size() > max_bytes) return result;
    const bool stuck = at_end && result.size() == before && status != Z_STREAM_END;
    if ((status != Z_OK && status != Z_STREAM_END) || stuck) break;
  }
  return input_error("the file is not packed by gzip, or is damaged").at(key, 0);
}

Error too_large(const std::string& key, std::size_t max_bytes) {
  return input_error(fmt::format("the file unpacks to more than {} bytes", max_bytes)).at(key, 0);
}

}  // namespace

Result<UnpackedFiles::Content> UnpackedFiles::unpack(const Bytes& packed, const std::string& key,
                                                     std::size_t max_bytes) const {
  Charge charge(budget());
  CANDELA_ASSIGN(std::string text, description::unpack(packed.view, key, max_bytes, charge));
  const std::size_t grown = text.capacity();
  text.shrink_to_fit();
  charge.give_back(grown - text.capacity());
  return Content{std::move(text), std::move(charge)};
}

Result<FileSource::Bytes> UnpackedFiles::open(const std::string& key) const {
  return open(key, max_unpacked_bytes);
}

Result<FileSource::Bytes> UnpackedFiles::open(const std::string& key, std::size_t max_bytes) const {
  if (key.ends_with(".pbrt")) {
    const Lock lock(mutex_);
    if (key != text_key_) {
      text_ = {};
      text_key_.clear();
      CANDELA_ASSIGN(text_, files_.open(key));
      text_key_ = key;
    }
    return text_;
  }
  if (!key.ends_with(".gz")) return files_.open(key);
  const Lock lock(mutex_);
  if (const auto known = unpacked_.find(key); known != unpacked_.end()) {
    if (known->second.view.size() > max_bytes) return too_large(key, max_bytes);
    return known->second;
  }
  CANDELA_ASSIGN(const Bytes packed, files_.open(key));
  CANDELA_ASSIGN(Content content, unpack(packed, key, max_bytes));
  if (content.text.size() > max_bytes) return too_large(key, max_bytes);
  auto owner = std::make_shared<const Content>(std::move(content));
  const std::string_view view = owner->text;
  return unpacked_.emplace(key, Bytes{std::move(owner), view}).first->second;
}

Result<FileSource::Bytes> UnpackedFiles::start(const std::string& key, std::size_t count) const {
  if (!key.ends_with(".gz")) return files_.start(key, count);
  CANDELA_ASSIGN(const Bytes bytes, files_.open(key));
  CANDELA_ASSIGN(Content content, unpack(bytes, key, count));
  auto owner = std::make_shared<const Content>(std::move(content));
  const std::string_view view = owner->text;
  return Bytes{std::move(owner), view};
}

}  // namespace candela::description
