#include "common/image/formats.h"

#include <algorithm>
#include <array>
#include <exception>

#include "common/image/byte_source.h"
#include "common/image/exr.h"
#include "common/image/jpeg.h"
#include "common/image/png.h"

namespace candela::image {
namespace {

using namespace std::string_view_literals;

constexpr std::size_t kMagicBytes = 16;  // that tell formats apart

Error unreadable(const std::string& why) {
  return input_error("this is not an image that can be read: " + why);
}

// The readers of this library; null for other formats.
std::unique_ptr<ImageReader> open_own(std::string_view format, std::unique_ptr<ByteSource>& source,
                                      const std::string& name, bool straight_colors, std::string& error) {
  if (format == "openexr") return open_exr(std::move(source), name, error);
  if (format == "png") return open_png(std::move(source), straight_colors, error);
  if (format == "jpeg") return open_jpeg(std::move(source), error);
  return nullptr;
}

bool is_own(std::string_view format) {
  return format == "openexr" || format == "png" || format == "jpeg";
}

// The format of a file by its first bytes and its name; null: none of those that format_of() knows.
Result<const char*> format_in(ByteSource& source, const std::string& name) {
  std::array<char, kMagicBytes> magic{};
  const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(kMagicBytes, source.size()));
  if (!source.read(0, count, magic.data())) return input_error("cannot read the file").at(name, 0);
  return format_of({magic.data(), count}, name);
}

// Libraries throw on hostile files.
template <class Open>
Result<std::unique_ptr<ImageReader>> open_by(Open&& open) {
  std::string error;
  try {
    std::unique_ptr<ImageReader> reader = open(error);
    if (reader) return reader;
  } catch (const std::bad_alloc&) {
    return resource_error("the image does not fit into memory");
  } catch (const std::exception& problem) {
    error = problem.what();
  }
  return unreadable(one_line(error));
}

}  // namespace

const char* format_of(std::string_view bytes, std::string_view file) {
  if (bytes.starts_with("\x76\x2f\x31\x01"sv)) return "openexr";
  if (bytes.starts_with("\x89PNG\r\n\x1a\n"sv)) return "png";
  if (bytes.starts_with("\xff\xd8\xff"sv)) return "jpeg";
  if (bytes.starts_with("#?RADIANCE"sv) || bytes.starts_with("#?RGBE"sv)) return "hdr";
  if (bytes.starts_with("II*\0"sv) || bytes.starts_with("MM\0*"sv)) return "tiff";
  if (bytes.starts_with("BM"sv)) return "bmp";
  if (bytes.size() > 2 && bytes[0] == 'P' && "123456Ff"sv.find(bytes[1]) != std::string_view::npos)
    return "pnm";
  if (file.ends_with(".tga") || file.ends_with(".TGA")) return "targa";
  return nullptr;
}

Result<void> check_readable(const std::filesystem::path& path) {
  const std::string name = path.string();
  const auto source = file_source(path);
  if (!source.ok()) return {};
  const auto format = format_in(**source, name);
  if (!format.ok() || *format == nullptr || is_own(*format)) return {};
  auto there = check_image_module();
  if (!there.ok()) return std::move(there).error().at(name, 0);
  return {};
}

Result<std::unique_ptr<ImageReader>> open_file(const std::filesystem::path& path) {
  const std::string name = path.string();
  CANDELA_ASSIGN(std::unique_ptr<ByteSource> source, file_source(path));
  CANDELA_ASSIGN(const char* const format, format_in(*source, name));
  Result<std::unique_ptr<ImageReader>> reader = std::unique_ptr<ImageReader>();
  if (format != nullptr && is_own(format)) {
    reader = open_by([&](std::string& error) { return open_own(format, source, name, false, error); });
  } else {
    const auto codec = image_codec();
    if (!codec.ok()) return Error(codec.error()).at(name, 0);
    reader = open_by([&](std::string& error) { return (*codec)->open_file(name, error); });
  }
  if (!reader.ok()) return std::move(reader).error().at(name, 0);
  return reader;
}

Result<std::unique_ptr<ImageReader>> open_bytes(std::string_view bytes, const char* format,
                                                const std::string& name, bool straight_colors) {
  if (is_own(format)) {
    std::unique_ptr<ByteSource> source = memory_source(bytes);
    return open_by(
        [&](std::string& error) { return open_own(format, source, name, straight_colors, error); });
  }
  CANDELA_ASSIGN(const ImageCodec* const codec, image_codec());
  return open_by(
      [&](std::string& error) { return codec->open_bytes(bytes, format, name, straight_colors, error); });
}

std::string one_line(std::string text) {
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';
  while (!text.empty() && text.back() == ' ') text.pop_back();
  return text;
}

std::string image_libraries() {
  return exr_library() + ", " + png_library() + ", " + jpeg_library();
}

}  // namespace candela::image
