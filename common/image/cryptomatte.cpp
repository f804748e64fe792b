#include "common/image/cryptomatte.h"

#include <fmt/format.h>

#include <bit>
#include <cstddef>

namespace candela::image {
namespace {

// The number of bytes of the UTF-8 character at the front; 0: there is none.
std::size_t utf8_length(std::string_view text) {
  const auto byte = [&](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U; };
  const auto follows = [&](std::size_t i) { return (byte(i) & 0xc0U) == 0x80U; };
  const unsigned first = byte(0);
  if (first < 0x80) return 1;
  if (first >= 0xc2 && first < 0xe0) return follows(1) ? 2 : 0;
  if (first >= 0xe0 && first < 0xf0) {
    const bool overlong = first == 0xe0 && byte(1) < 0xa0, surrogate = first == 0xed && byte(1) >= 0xa0;
    return follows(1) && follows(2) && !overlong && !surrogate ? 3 : 0;
  }
  if (first >= 0xf0 && first < 0xf5) {
    const bool overlong = first == 0xf0 && byte(1) < 0x90, beyond = first == 0xf4 && byte(1) >= 0x90;
    return follows(1) && follows(2) && follows(3) && !overlong && !beyond ? 4 : 0;
  }
  return 0;
}

std::string json_text(std::string_view text) {
  std::string out = "\"";
  while (!text.empty()) {
    const std::size_t length = utf8_length(text);
    const char first = text.front();
    if (length == 0)
      out += "\\ufffd";
    else if (first == '"' || first == '\\')
      out += {'\\', first};
    else if (static_cast<unsigned char>(first) < 0x20)
      out += fmt::format("\\u{:04x}", static_cast<unsigned>(first));
    else
      out += text.substr(0, length);
    text.remove_prefix(length == 0 ? 1 : length);
  }
  return out + '"';
}

}  // namespace

std::uint32_t murmur3_32(std::string_view text) {
  const auto byte = [&](std::size_t i) {
    return static_cast<std::uint32_t>(static_cast<unsigned char>(text[i]));
  };
  const auto scrambled = [](std::uint32_t k) { return std::rotl(k * 0xcc9e2d51U, 15) * 0x1b873593U; };
  std::uint32_t h = 0;
  const std::size_t whole = text.size() / 4 * 4;
  for (std::size_t i = 0; i < whole; i += 4) {
    h ^= scrambled(byte(i) | byte(i + 1) << 8 | byte(i + 2) << 16 | byte(i + 3) << 24);
    h = std::rotl(h, 13) * 5 + 0xe6546b64U;
  }
  std::uint32_t tail = 0;
  for (std::size_t i = text.size(); i-- > whole;) tail = tail << 8 | byte(i);
  h ^= scrambled(tail);
  h ^= static_cast<std::uint32_t>(text.size());
  h = (h ^ h >> 16) * 0x85ebca6bU;
  h = (h ^ h >> 13) * 0xc2b2ae35U;
  return h ^ h >> 16;
}

std::uint32_t matte_id_bits(std::string_view name) {
  const std::uint32_t hash = murmur3_32(name), exponent = hash >> 23 & 0xff;
  // Zeros, denormals, infinities and NaNs do not survive all programs [Friedman and Jones 2015].
  return exponent == 0 || exponent == 0xff ? hash ^ 1U << 23 : hash;
}

std::string matte_manifest(std::span<const std::string> names) {
  std::string out = "{";
  for (const std::string& name : names)
    out += fmt::format("{}{}:\"{:08x}\"", out.size() > 1 ? "," : "", json_text(name), matte_id_bits(name));
  return out + '}';
}

void add_matte_attributes(std::string_view layer, std::span<const std::string> names,
                          std::map<std::string, std::string>& attributes) {
  constexpr std::size_t kKeyDigits = 7;
  const std::string key =
      "cryptomatte/" + fmt::format("{:08x}", matte_id_bits(layer)).substr(0, kKeyDigits) + "/";
  attributes[key + "name"] = layer;
  attributes[key + "hash"] = "MurmurHash3_32";
  attributes[key + "conversion"] = "uint32_to_float32";
  attributes[key + "manifest"] = matte_manifest(names);
}

}  // namespace candela::image
