// A walk over the bytes of an OpenVDB grid without OpenVDB, which trusts the lengths and compressed blocks it
// reads: what passes here it can parse.
#pragma once

#include <cstdint>
#include <cstring>
#include <string_view>

namespace candela::loaders::vdb {

// Takes what lies at the front of the bytes; too short once is too short for good.
struct Walk {
  std::string_view bytes;
  std::size_t at = 0;
  bool ok = true;

  std::string_view take(std::uint64_t count) {
    if (!ok || count > bytes.size() - at) {
      ok = false;
      return {};
    }
    at += static_cast<std::size_t>(count);
    return bytes.substr(at - static_cast<std::size_t>(count), static_cast<std::size_t>(count));
  }
  template <class T>
  T number() {
    T value{};
    const std::string_view from = take(sizeof value);
    if (ok) std::memcpy(&value, from.data(), sizeof value);
    return value;
  }
  std::string_view text() { return take(number<std::uint32_t>()); }
};

struct Layout {
  std::uint32_t compression = 0;   // OpenVDB's flags
  std::uint64_t value_bytes = 0;   // of a value in memory
  std::uint64_t stored_bytes = 0;  // of one in a block of values: less for halves
};

// From the tree's number of buffers to the last value of its leaves: a tree of OpenVDB's usual shape (nodes
// of 32^3, 16^3 and 8^3), file version 222 or later. Sets walk.ok.
void check_tree(Walk& walk, const Layout& layout);

}  // namespace candela::loaders::vdb
