#include "worker/scene/textures/pnm.h"

#include <bit>
#include <charconv>
#include <cmath>
#include <cstddef>

namespace candela::scene {
namespace {

bool is_space(char c) {
  return c == ' ' || (c >= '\t' && c <= '\r');
}

// The next word of a header; comments run from # to the line's end.
std::string_view next_word(std::string_view bytes, std::size_t& at) {
  while (at < bytes.size() && (is_space(bytes[at]) || bytes[at] == '#')) {
    if (bytes[at] == '#') {
      while (at < bytes.size() && bytes[at] != '\n') ++at;
    } else {
      ++at;
    }
  }
  const std::size_t begin = at;
  while (at < bytes.size() && !is_space(bytes[at])) ++at;
  return bytes.substr(begin, at - begin);
}

template <class T>
bool to_number(std::string_view word, T& value) {
  const auto [end, code] = std::from_chars(word.data(), word.data() + word.size(), value);
  return code == std::errc() && end == word.data() + word.size();
}

std::uint32_t byte_at(std::string_view bytes, std::size_t i) {
  return static_cast<unsigned char>(bytes[i]);
}

}  // namespace

std::optional<PnmFile> PnmFile::parse(std::string_view bytes) {
  PnmFile file;
  std::size_t at = 0;
  const std::string_view magic = next_word(bytes, at);
  const bool floats = magic == "Pf" || magic == "PF";
  if (!floats && magic != "P5" && magic != "P6") return std::nullopt;
  file.channels = magic == "P6" || magic == "PF" ? 3 : 1;
  if (!to_number(next_word(bytes, at), file.width) || !to_number(next_word(bytes, at), file.height) ||
      file.width < 1 || file.height < 1)
    return std::nullopt;
  const std::string_view last = next_word(bytes, at);
  std::uint64_t size = 4;
  if (floats) {
    if (!to_number(last, file.scale) || !std::isfinite(file.scale) || file.scale == 0) return std::nullopt;
    file.big_endian = file.scale > 0;
    file.scale = std::abs(file.scale);
  } else {
    if (!to_number(last, file.most) || file.most < 1 || file.most > 65535) return std::nullopt;
    size = file.most < 256 ? 1 : 2;
  }
  if (at >= bytes.size()) return std::nullopt;
  file.pixels = bytes.substr(at + 1);  // one space ends the header
  const std::uint64_t row =
      static_cast<std::uint64_t>(file.width) * static_cast<std::uint64_t>(file.channels) * size;
  if (file.pixels.size() / row < static_cast<std::uint64_t>(file.height)) return std::nullopt;
  return file;
}

bool PnmFile::row(int y, std::uint8_t* out) const {
  const auto n = static_cast<std::size_t>(width) * static_cast<std::size_t>(channels);
  const std::string_view from = pixels.substr(static_cast<std::size_t>(y) * n, n);
  for (std::size_t i = 0; i < n; ++i) out[i] = static_cast<std::uint8_t>(byte_at(from, i));
  return true;
}

bool PnmFile::row(int y, std::uint16_t* out) const {
  const auto n = static_cast<std::size_t>(width) * static_cast<std::size_t>(channels);
  const std::size_t size = most < 256 ? 1 : 2;
  const std::string_view from = pixels.substr(static_cast<std::size_t>(y) * n * size, n * size);
  for (std::size_t i = 0; i < n; ++i) {
    const std::uint32_t v =
        size == 1 ? byte_at(from, i) : byte_at(from, 2 * i) << 8 | byte_at(from, 2 * i + 1);
    if (v > most) return false;
    out[i] = static_cast<std::uint16_t>((v * 65535 + most / 2) / most);
  }
  return true;
}

bool PnmFile::row(int y, float* out) const {
  const auto n = static_cast<std::size_t>(width) * static_cast<std::size_t>(channels);
  const std::string_view from = pixels.substr(static_cast<std::size_t>(height - 1 - y) * n * 4, n * 4);
  for (std::size_t i = 0; i < n; ++i) {
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 4; ++k) bits |= byte_at(from, 4 * i + k) << (big_endian ? 24 - 8 * k : 8 * k);
    out[i] = std::bit_cast<float>(bits) * scale;
  }
  return true;
}

}  // namespace candela::scene
