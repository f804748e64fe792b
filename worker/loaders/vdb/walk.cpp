#include "worker/loaders/vdb/walk.h"

#include <blosc.h>
#include <openvdb/io/Compression.h>

#include <array>
#include <bit>
#include <limits>
#include <tuple>

namespace candela::loaders::vdb {
namespace {

namespace io = openvdb::io;

constexpr std::array<std::uint64_t, 3> kCells = {512, 4096, 32768};  // of a leaf, of the nodes above

std::uint64_t count_on(std::string_view mask) {
  std::uint64_t on = 0;
  for (const char c : mask) on += static_cast<std::uint64_t>(std::popcount(static_cast<unsigned char>(c)));
  return on;
}

// A block of `size` bytes: raw, or its length and then compressed, or minus its length and then raw.
void check_block(Walk& walk, std::uint64_t size, std::uint32_t compression) {
  if ((compression & (io::COMPRESS_BLOSC | io::COMPRESS_ZIP)) == 0) {
    walk.take(size);
    return;
  }
  const auto length = walk.number<std::int64_t>();
  if (!walk.ok) return;
  if (length <= 0) {
    // OpenVDB reads this many bytes before it compares.
    if (length == std::numeric_limits<std::int64_t>::min() || static_cast<std::uint64_t>(-length) != size)
      walk.ok = false;
    else
      walk.take(size);
    return;
  }
  const std::string_view block = walk.take(static_cast<std::uint64_t>(length));
  if (!walk.ok || (compression & io::COMPRESS_BLOSC) == 0) return;  // zlib looks after itself
  std::size_t unpacked = 0;
  walk.ok = blosc_cbuffer_validate(block.data(), block.size(), &unpacked) == 0 && unpacked == size;
}

void check_values(Walk& walk, const Layout& layout, std::uint64_t cells, std::uint64_t active) {
  const auto kind = walk.number<std::int8_t>();
  if (kind < io::NO_MASK_OR_INACTIVE_VALS || kind > io::NO_MASK_AND_ALL_VALS) walk.ok = false;
  const bool one = kind == io::NO_MASK_AND_ONE_INACTIVE_VAL || kind == io::MASK_AND_ONE_INACTIVE_VAL;
  const bool two = kind == io::MASK_AND_TWO_INACTIVE_VALS;
  walk.take((two ? 2u : one ? 1u : 0u) * layout.value_bytes);
  if (two || kind == io::MASK_AND_NO_INACTIVE_VALS || kind == io::MASK_AND_ONE_INACTIVE_VAL)
    walk.take(cells / 8);
  const bool only_active =
      (layout.compression & io::COMPRESS_ACTIVE_MASK) != 0 && kind != io::NO_MASK_AND_ALL_VALS;
  const std::uint64_t count = only_active ? active : cells;
  if (count == 0 && layout.stored_bytes != layout.value_bytes) return;  // of halves, nothing is stored then
  check_block(walk, count * layout.stored_bytes, layout.compression);
}

// Adds the leaves below to `leaves`.
void check_node(Walk& walk, const Layout& layout, std::size_t level, std::uint64_t& leaves) {
  if (level == 0) {
    walk.take(kCells[0] / 8);
    ++leaves;
    return;
  }
  const std::string_view children = walk.take(kCells[level] / 8), active = walk.take(kCells[level] / 8);
  // A cell that is a child and an active value would have the child's address for a value.
  for (std::size_t i = 0; walk.ok && i < children.size(); ++i)
    if ((children[i] & active[i]) != 0) walk.ok = false;
  if (walk.ok) check_values(walk, layout, kCells[level], count_on(active));
  for (std::uint64_t i = 0, count = count_on(children); walk.ok && i < count; ++i)
    check_node(walk, layout, level - 1, leaves);
}

}  // namespace

void check_tree(Walk& walk, const Layout& layout) {
  if (walk.number<std::int32_t>() != 1) walk.ok = false;  // buffers
  walk.take(layout.value_bytes);                          // the background
  const auto tiles = walk.number<std::uint32_t>(), children = walk.number<std::uint32_t>();
  // Sorted, as OpenVDB writes them: it reads the leaves' values in this order, whatever that of the nodes
  // was.
  using Origin = std::tuple<std::int32_t, std::int32_t, std::int32_t>;
  Origin last;
  const auto origin = [&](bool first) {
    const auto x = walk.number<std::int32_t>(), y = walk.number<std::int32_t>(),
               z = walk.number<std::int32_t>();
    for (const std::int32_t i : {x, y, z})  // aligned, and far from where indices would overflow
      if (i % 4096 != 0 || i < -(1 << 30) || i > (1 << 30)) walk.ok = false;
    if (!first && !(last < Origin(x, y, z))) walk.ok = false;
    last = {x, y, z};
  };
  for (std::uint32_t i = 0; walk.ok && i < tiles; ++i) {
    origin(i == 0);
    walk.take(layout.value_bytes);
    if (static_cast<unsigned char>(walk.number<char>()) > 1) walk.ok = false;  // active: a bool
  }
  std::uint64_t leaves = 0;
  for (std::uint32_t i = 0; walk.ok && i < children; ++i) {
    origin(i == 0);
    check_node(walk, layout, 2, leaves);
  }
  for (std::uint64_t i = 0; walk.ok && i < leaves; ++i) {
    const std::string_view active = walk.take(kCells[0] / 8);
    if (walk.ok) check_values(walk, layout, kCells[0], count_on(active));
  }
}

}  // namespace candela::loaders::vdb
