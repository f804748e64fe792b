#include "common/base/text.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

namespace candela {
namespace {

unsigned char byte_at(std::string_view text, std::size_t i) {
  return static_cast<unsigned char>(text[i]);
}

// The code point of a sequence of `length` bytes.
std::uint32_t code_point(std::string_view text, std::size_t length) {
  if (length == 1) return byte_at(text, 0);
  std::uint32_t code = byte_at(text, 0) & (0x7FU >> length);
  for (std::size_t i = 1; i < length; ++i) code = (code << 6) | (byte_at(text, i) & 0x3FU);
  return code;
}

bool is_unprintable(std::uint32_t code) {
  // First and last of each range: C0; DEL and C1; and of Unicode's separators of lines and paragraphs, its
  // format characters (Cf), its fillers without a shape, its noncharacters at the end of the BMP, and its
  // tags.
  constexpr std::array<std::pair<std::uint32_t, std::uint32_t>, 17> kRanges = {{{0x0000, 0x001F},
                                                                                {0x007F, 0x009F},
                                                                                {0x00AD, 0x00AD},
                                                                                {0x034F, 0x034F},
                                                                                {0x0600, 0x0605},
                                                                                {0x061C, 0x061C},
                                                                                {0x06DD, 0x06DD},
                                                                                {0x070F, 0x070F},
                                                                                {0x115F, 0x1160},
                                                                                {0x180B, 0x180F},
                                                                                {0x200B, 0x200F},
                                                                                {0x2028, 0x202E},
                                                                                {0x2060, 0x206F},
                                                                                {0x3164, 0x3164},
                                                                                {0xFEFF, 0xFEFF},
                                                                                {0xFFF0, 0xFFFF},
                                                                                {0xE0000, 0xE0FFF}}};
  if (code == 0xFFFD) return false;  // the replacement character says of itself what it is
  return std::any_of(kRanges.begin(), kRanges.end(),
                     [code](const auto& range) { return code >= range.first && code <= range.second; });
}

std::string escape_of(std::uint32_t code) {
  if (code == '\n') return "\\n";
  if (code == '\r') return "\\r";
  if (code == '\t') return "\\t";
  if (code < 0x80) return fmt::format("\\x{:02x}", code);
  return code <= 0xFFFF ? fmt::format("\\u{:04x}", code) : fmt::format("\\U{:08x}", code);
}

}  // namespace

std::size_t utf8_length(std::string_view text) {
  const unsigned char first = byte_at(text, 0);
  if (first < 0x80) return 1;
  const std::size_t length = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
  if (first < 0xC2 || first > 0xF4 || text.size() < length) return 0;
  for (std::size_t i = 1; i < length; ++i)
    if ((byte_at(text, i) & 0xC0) != 0x80) return 0;
  if (first == 0xE0 && byte_at(text, 1) < 0xA0) return 0;
  if (first == 0xED && byte_at(text, 1) >= 0xA0) return 0;
  if (first == 0xF0 && byte_at(text, 1) < 0x90) return 0;
  if (first == 0xF4 && byte_at(text, 1) >= 0x90) return 0;
  return length;
}

bool is_utf8(std::string_view text) {
  while (!text.empty()) {
    const std::size_t length = utf8_length(text);
    if (length == 0) return false;
    text.remove_prefix(length);
  }
  return true;
}

std::string_view clip_utf8(std::string_view text, std::size_t max_bytes) {
  if (text.size() <= max_bytes) return text;
  std::size_t end = max_bytes;
  while (end > 0 && (byte_at(text, end) & 0xC0) == 0x80) --end;
  return text.substr(0, end);
}

std::string quote(std::string_view text) {
  constexpr std::size_t max_bytes = 80;
  std::string result = "'";
  while (!text.empty()) {
    const std::size_t length = utf8_length(text);
    if (result.size() + length > max_bytes) {
      result += "...";
      break;
    }
    const auto first = static_cast<unsigned char>(text.front());
    if (length == 0 || first < 0x20 || first == 0x7F) {
      result += '?';
      text.remove_prefix(1);
    } else {
      result += text.substr(0, length);
      text.remove_prefix(length);
    }
  }
  return result + "'";
}

std::string escape_unprintable(std::string_view text) {
  std::string out;
  out.reserve(text.size());
  while (!text.empty()) {
    const std::size_t length = utf8_length(text);
    if (length == 0) {
      out += fmt::format("\\x{:02x}", static_cast<unsigned>(byte_at(text, 0)));
      text.remove_prefix(1);
      continue;
    }
    const std::uint32_t code = code_point(text, length);
    if (is_unprintable(code))
      out += escape_of(code);
    else
      out += text.substr(0, length);
    text.remove_prefix(length);
  }
  return out;
}

std::string escape_json_unprintable(std::string_view json) {
  std::string out;
  out.reserve(json.size());
  while (!json.empty()) {
    const std::size_t length = std::max<std::size_t>(utf8_length(json), 1);
    const std::uint32_t code = code_point(json, length);
    if (code < 0x7F || !is_unprintable(code)) {  // below 0x20 there is only white space between values
      out += json.substr(0, length);
    } else if (code <= 0xFFFF) {
      out += fmt::format("\\u{:04x}", code);
    } else {  // a surrogate pair
      out += fmt::format("\\u{:04x}\\u{:04x}", 0xD800 + ((code - 0x10000) >> 10),
                         0xDC00 + ((code - 0x10000) & 0x3FF));
    }
    json.remove_prefix(length);
  }
  return out;
}

}  // namespace candela
