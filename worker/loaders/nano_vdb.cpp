// The layout is that of NanoVDB 32 (NanoVDB.h and util/IO.h of OpenVDB 10): a file is a list of segments, a
// segment a header, the metadata of its grids, and the grids; a grid is a tree of root, upper nodes (32^3
// lower nodes), lower nodes (16^3 leaves) and leaves (8^3 voxels), whose children are byte offsets.
#include "worker/loaders/nano_vdb.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <set>
#include <vector>

#include "common/base/work_monitor.h"

namespace candela::loaders {
namespace {

static_assert(std::endian::native == std::endian::little, "the format is little-endian and read as it lies");

using Index = std::array<std::int64_t, 3>;

constexpr std::uint32_t kMajorVersion = 32, kFloatGrid = 1;
constexpr std::uint16_t kNoCodec = 0, kZip = 1;
constexpr std::size_t kSegmentBytes = 16, kMetaBytes = 176;
// A few bytes must not make a grid of gigabytes. A tile of the root is 4096^3 voxels and beyond our limits,
// so that a grid which we read has an upper node: 270 kB, which may be 2^30 values.
constexpr std::uint64_t kMaxValuesPerByte = 4096;
constexpr std::size_t kGridBytes = 672, kTreeBytes = 64, kRootBytes = 64, kTileBytes = 32;

// A kind of inner node: 2^(3 log2) children of 2^child_log2 voxels a side.
struct NodeLayout {
  int log2, child_log2;
  std::size_t child_mask, values, bytes;
};
constexpr NodeLayout kUpper = {5, 7, 32 + 4096, 8256, 8256 + std::size_t{8} * 32768};
constexpr NodeLayout kLower = {4, 3, 32 + 512, 1088, 1088 + std::size_t{8} * 4096};
constexpr std::size_t kLeafValues = 96, kLeafBytes = 96 + std::size_t{4} * 512;

// Reads within bounds; outside of them values are zero and ok() is false from then on.
class Reader {
 public:
  explicit Reader(std::string_view bytes) : bytes_(bytes) {}
  bool ok() const { return ok_; }
  bool holds(std::uint64_t offset, std::uint64_t count) {
    ok_ = ok_ && offset <= bytes_.size() && count <= bytes_.size() - offset;
    return ok_;
  }
  template <class T>
  T get(std::uint64_t offset) {
    T value{};
    if (holds(offset, sizeof value)) std::memcpy(&value, bytes_.data() + offset, sizeof value);
    return value;
  }

 private:
  std::string_view bytes_;
  bool ok_ = true;
};

// One grid, decompressed.
class Grid {
 public:
  Grid(std::string_view bytes, const std::string& name, std::uint64_t most_values)
      : bytes_(bytes), in_(bytes), name_(name), most_values_(most_values) {}

  Result<VolumeData> read() {
    CANDELA_TRY(place());
    data_.channels = 1;
    data_.values.assign(static_cast<std::size_t>(cells_), in_.get<float>(root_ + 28));
    const auto tiles = in_.get<std::uint32_t>(root_ + 24);
    // Tiles of one place would fill the grid once each: a small file would take hours.
    std::set<Index> places;
    for (std::uint64_t i = 0; i < tiles && in_.ok(); ++i) {
      work_step();
      const std::uint64_t tile = root_ + kRootBytes + i * kTileBytes;
      const Index origin = tile_origin(in_.get<std::uint64_t>(tile));
      if (!places.insert(origin).second) return fail("the NanoVDB file is damaged: two tiles have one place");
      root_tile(tile, origin);
    }
    if (!in_.ok()) return damaged();
    for (float& value : data_.values) {
      if (!std::isfinite(value)) return fail("a value of the grid is not finite");
      if (value < 0) {
        ++data_.negative_count;
        value = 0;
      }
    }
    return std::move(data_);
  }

 private:
  Error fail(std::string message) const { return input_error(std::move(message)).at(name_, 0); }
  Error damaged() const { return fail("the NanoVDB file is damaged: a part of it lies outside of it"); }

  // The size of the grid, and its box in the world.
  Result<void> place() {
    const auto type = in_.get<std::uint32_t>(636);
    if (!in_.ok()) return damaged();
    if (type != kFloatGrid) return fail("the NanoVDB grid does not hold floats");
    root_ = kGridBytes + in_.get<std::uint64_t>(kGridBytes + 24);
    cells_ = 1;
    for (std::size_t i = 0; i < 3; ++i) {
      low_[i] = in_.get<std::int32_t>(root_ + 4 * i);
      const std::int64_t high = in_.get<std::int32_t>(root_ + 12 + 4 * i);
      if (!in_.ok()) return damaged();
      if (high < low_[i]) return fail("the NanoVDB grid has no active voxels");
      const auto size = static_cast<std::uint64_t>(high - low_[i] + 1);
      if (size > most_values_ || (cells_ *= size) > most_values_)
        return fail("the box around the grid's active voxels has more than " + std::to_string(most_values_) +
                    " values");
      data_.size[i] = static_cast<std::uint32_t>(size);
      size_[i] = static_cast<std::int64_t>(size);
    }
    if (cells_ / kMaxValuesPerByte > bytes_.size())
      return fail("the NanoVDB grid has " + std::to_string(bytes_.size()) + " bytes, too few for the " +
                  std::to_string(cells_) + " values of the box around its active voxels");
    std::array<float, 3> low{}, high{};
    constexpr std::uint64_t kMatrix = 296 + 88, kTranslation = kMatrix + 144;
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j)
        if (i != j && in_.get<double>(kMatrix + 8 * (3 * i + j)) != 0)
          return fail("the transform of the NanoVDB grid turns or shears it");
      const double scale = in_.get<double>(kMatrix + 8 * (4 * i));
      const double origin = in_.get<double>(kTranslation + 8 * i);
      if (!(scale > 0) || !std::isfinite(scale) || !std::isfinite(origin))
        return fail("the transform of the NanoVDB grid flattens or mirrors it");
      low[i] = static_cast<float>(origin + scale * (static_cast<double>(low_[i]) - 0.5));
      high[i] = static_cast<float>(origin + scale * (static_cast<double>(low_[i] + size_[i]) - 0.5));
    }
    data_.low = {low[0], low[1], low[2]};
    data_.high = {high[0], high[1], high[2]};
    return in_.ok() ? Result<void>() : damaged();
  }

  // The key has 21 bits of each coordinate, in units of 4096 voxels.
  static Index tile_origin(std::uint64_t key) {
    Index origin;
    for (std::size_t i = 0; i < 3; ++i)
      origin[i] =
          static_cast<std::int32_t>(static_cast<std::uint32_t>(key >> (42 - 21 * i) & 0x1fffff) << 12);
    return origin;
  }

  void root_tile(std::uint64_t tile, const Index& origin) {
    const auto child = in_.get<std::int64_t>(tile + 8);
    if (child == 0)
      fill(origin, 4096, in_.get<float>(tile + 20));
    else
      node(root_ + static_cast<std::uint64_t>(child), origin, kUpper);
  }

  // Each node has its own place in the file, so that a file of so many bytes has not more of them.
  bool enter(std::uint64_t offset, std::size_t bytes) {
    visited_ += bytes;
    return in_.holds(offset, bytes) && in_.holds(0, visited_);
  }

  void node(std::uint64_t offset, const Index& origin, const NodeLayout& layout) {
    if (!enter(offset, layout.bytes)) return;
    const int side_log2 = layout.log2;
    for (std::uint32_t i = 0; i < 1U << (3 * side_log2) && in_.ok(); ++i) {
      const std::uint32_t mask = (1U << side_log2) - 1;
      const std::array<std::uint32_t, 3> at = {i >> (2 * side_log2), i >> side_log2 & mask, i & mask};
      Index corner;
      for (std::size_t k = 0; k < 3; ++k)
        corner[k] = origin[k] + (static_cast<std::int64_t>(at[k]) << layout.child_log2);
      const auto word = in_.get<std::uint64_t>(offset + layout.child_mask + i / 64 * 8);
      const std::uint64_t value = offset + layout.values + std::uint64_t{8} * i;
      if ((word >> (i % 64) & 1) == 0) {
        fill(corner, std::int64_t{1} << layout.child_log2, in_.get<float>(value));
        continue;
      }
      const std::uint64_t child = offset + static_cast<std::uint64_t>(in_.get<std::int64_t>(value));
      if (layout.child_log2 == kUpper.child_log2)
        node(child, corner, kLower);
      else
        leaf(child, corner);
    }
  }

  void leaf(std::uint64_t offset, const Index& origin) {
    if (!enter(offset, kLeafBytes)) return;
    work_step();
    for (std::uint32_t i = 0; i < 512; ++i)
      fill({origin[0] + (i >> 6), origin[1] + (i >> 3 & 7), origin[2] + (i & 7)}, 1,
           in_.get<float>(offset + kLeafValues + std::uint64_t{4} * i));
  }

  // Voxels of a cube, as far as they lie in the box.
  void fill(const Index& corner, std::int64_t side, float value) {
    Index first, last;
    for (std::size_t k = 0; k < 3; ++k) {
      first[k] = std::max<std::int64_t>(corner[k] - low_[k], 0);
      last[k] = std::min(corner[k] - low_[k] + side, size_[k]);
      if (first[k] >= last[k]) return;
    }
    for (std::int64_t z = first[2]; z < last[2]; ++z) {
      work_step(static_cast<std::size_t>(z));
      for (std::int64_t y = first[1]; y < last[1]; ++y) {
        const auto row = data_.values.begin() + (z * size_[1] + y) * size_[0];
        std::fill(row + first[0], row + last[0], value);
      }
    }
  }

  std::string_view bytes_;
  Reader in_;
  const std::string& name_;
  const std::uint64_t most_values_;
  std::uint64_t root_ = 0, cells_ = 0, visited_ = 0;
  Index low_{}, size_{};
  VolumeData data_;
};

Result<std::vector<char>> unzip(std::string_view bytes, std::uint64_t size, const std::string& name) {
  const auto fail = [&] {
    return input_error("the compressed data of the NanoVDB file is damaged").at(name, 0);
  };
  // Deflate makes at most 1032 bytes of one.
  if (size / 1032 > bytes.size()) return fail();
  std::vector<char> out(static_cast<std::size_t>(size));
  uLongf count = out.size();
  const int status = uncompress(reinterpret_cast<Bytef*>(out.data()), &count,
                                reinterpret_cast<const Bytef*>(bytes.data()), bytes.size());
  if (status != Z_OK || count != out.size()) return fail();
  return out;
}

}  // namespace

Result<VolumeData> load_nano_vdb(std::string_view bytes, const std::string& name, const std::string& grid,
                                 std::uint64_t most_values) {
  const auto fail = [&](std::string message) { return input_error(std::move(message)).at(name, 0); };
  Reader in(bytes);
  std::vector<std::string> known;
  for (std::uint64_t segment = 0; segment < bytes.size();) {
    const std::uint32_t version = in.get<std::uint32_t>(segment + 8) >> 21;
    const auto count = in.get<std::uint16_t>(segment + 12), codec = in.get<std::uint16_t>(segment + 14);
    if (!in.ok() || !is_nano_vdb(bytes.substr(segment))) return fail("the NanoVDB file is damaged");
    if (version != kMajorVersion)
      return fail("the NanoVDB file is of the version " + std::to_string(version) + ", and " +
                  std::to_string(kMajorVersion) + " is supported")
          .with_mend("convert it with nanovdb_convert of OpenVDB 10, from a .vdb file");
    if (codec != kNoCodec && codec != kZip)
      return fail("the NanoVDB file is compressed by BLOSC")
          .with_mend("write it without compression or with ZIP (nanovdb_convert --zip)");
    struct Meta {
      std::uint64_t grid_bytes, file_bytes;
      std::string name;
    };
    std::vector<Meta> grids;
    std::uint64_t at = segment + kSegmentBytes;
    for (std::uint16_t i = 0; i < count; ++i) {
      Meta meta{in.get<std::uint64_t>(at), in.get<std::uint64_t>(at + 8), {}};
      const auto name_bytes = in.get<std::uint32_t>(at + 136);
      at += kMetaBytes;
      if (!in.holds(at, name_bytes)) return fail("the NanoVDB file is damaged");
      meta.name = std::string(bytes.substr(at, name_bytes));
      meta.name.resize(std::strlen(meta.name.c_str()));
      at += name_bytes;
      grids.push_back(std::move(meta));
    }
    for (const Meta& meta : grids) {
      if (!in.holds(at, meta.file_bytes)) return fail("the NanoVDB file is shorter than its grids");
      if (!grid.empty() && meta.name != grid) {
        known.push_back(meta.name);
        at += meta.file_bytes;
        continue;
      }
      std::string_view data = bytes.substr(at, meta.file_bytes);
      if (codec == kNoCodec) return Grid(data, name, most_values).read();
      if (data.size() < 8) return fail("the NanoVDB file is damaged");
      CANDELA_ASSIGN(const std::vector<char> unpacked, unzip(data.substr(8), meta.grid_bytes, name));
      return Grid({unpacked.data(), unpacked.size()}, name, most_values).read();
    }
    if (count == 0) return fail("the NanoVDB file has a segment without grids");
    segment = at;
  }
  std::string list;
  for (const std::string& other : known) list += (list.empty() ? "'" : ", '") + other + "'";
  return fail("the NanoVDB file has no grid '" + grid + "'")
      .with_mend("it has " + (list.empty() ? "none" : list));
}

}  // namespace candela::loaders
