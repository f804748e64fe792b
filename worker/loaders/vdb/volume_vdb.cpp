// Our code walks over the file to the wanted grid and through its tree, bounds every length written there,
// and makes a dense grid of the sparse one. OpenVDB reads the grid, from a stream that throws at its end.
//
#include "worker/loaders/vdb/volume_vdb.h"
#include "common/base/work_monitor.h"

#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <istream>
#include <optional>
#include <streambuf>

#include "worker/loaders/vdb/walk.h"

namespace candela::loaders {
namespace {

constexpr std::uint32_t kOldestVersion = 222;  // nodes were stored in another way before
constexpr std::string_view kHalfSuffix = "_HalfFloat";

using vdb::Walk;

void skip_metadata(Walk& walk, bool* half = nullptr) {
  const auto count = walk.number<std::uint32_t>();
  for (std::uint32_t i = 0; walk.ok && i < count; ++i) {
    const std::string_view name = walk.text();
    walk.text();  // type
    const std::string_view value = walk.text();
    if (half != nullptr && name == "is_saved_as_half_float") *half = !value.empty() && value[0] != 0;
  }
}

// The transforms that scale, turn, shear and move: how many bytes each is.
std::uint64_t bytes_of_map(std::string_view type) {
  using namespace openvdb::math;
  if (type == TranslationMap::mapType()) return 24;
  if (type == ScaleMap::mapType() || type == UniformScaleMap::mapType()) return 5 * 24;
  if (type == ScaleTranslateMap::mapType() || type == UniformScaleTranslateMap::mapType()) return 6 * 24;
  if (type == AffineMap::mapType() || type == UnitaryMap::mapType()) return 16 * 8;
  return 0;
}

struct Entry {
  std::string name, type;
  std::string_view descriptor;  // as it lies in the file
  std::string_view body;
  bool instance = false, half = false;
};

struct Directory {
  std::string_view header;  // magic, versions, flag and UUID
  std::vector<Entry> grids;
};

// A file's own words in an error: one line, no control characters, not endless.
std::string printable(std::string_view text) {
  std::string out(text.substr(0, 120));
  for (char& c : out)
    if (c < ' ' || c > '~') c = '?';
  return out;
}

std::string listed(const std::vector<Entry>& grids) {
  std::string out;
  for (std::size_t i = 0; i < std::min<std::size_t>(grids.size(), 20); ++i) {
    if (i > 0) out += ", ";
    out += "'" + printable(grids[i].name) + "'";
  }
  if (grids.size() > 20) out += " and more";
  return out;
}

Result<Directory> read_directory(std::string_view bytes) {
  Walk walk{bytes};
  walk.take(8);  // the magic number
  const auto version = walk.number<std::uint32_t>();
  if (walk.ok && (version < kOldestVersion || version > openvdb::OPENVDB_FILE_VERSION)) {
    return input_error("OpenVDB file version " + std::to_string(version) + " is not supported (" +
                       std::to_string(kOldestVersion) + " to " +
                       std::to_string(openvdb::OPENVDB_FILE_VERSION) + " are)");
  }
  walk.take(8);  // the library's version
  const bool has_offsets = walk.number<char>() != 0;
  walk.take(36);  // the UUID
  Directory directory;
  if (walk.ok) directory.header = bytes.substr(0, walk.at);
  skip_metadata(walk);
  const auto count = walk.number<std::int32_t>();
  if (walk.ok && !has_offsets) {
    return input_error("the OpenVDB file was written as a stream, without a table of its grids")
        .with_mend("write it with OpenVDB's io::File");
  }
  for (std::int32_t i = 0; walk.ok && i < count; ++i) {
    const std::size_t start = walk.at;
    Entry entry;
    // Grids of the same name are told apart by what follows a separator.
    const std::string_view name = walk.text();
    entry.name = std::string(name.substr(0, name.find('\x1e')));
    std::string_view type = walk.text();
    entry.half = type.ends_with(kHalfSuffix);
    if (entry.half) type.remove_suffix(kHalfSuffix.size());
    entry.type = std::string(type);
    entry.instance = !walk.text().empty();
    const auto body = walk.number<std::int64_t>();
    walk.take(8);  // where the values begin
    const auto end = walk.number<std::int64_t>();
    if (!walk.ok) break;
    entry.descriptor = bytes.substr(start, walk.at - start);
    if (body != static_cast<std::int64_t>(walk.at) || end < body ||
        static_cast<std::uint64_t>(end) > bytes.size()) {
      return input_error("the OpenVDB file is cut short or damaged: grid '" + printable(entry.name) +
                         "' does not lie where the file says");
    }
    entry.body = bytes.substr(walk.at, static_cast<std::size_t>(end - body));
    walk.at = static_cast<std::size_t>(end);
    directory.grids.push_back(std::move(entry));
  }
  if (!walk.ok) return input_error("the OpenVDB file is cut short or damaged");
  if (directory.grids.empty()) return input_error("the OpenVDB file holds no grid");
  return directory;
}

Result<const Entry*> choose(const std::vector<Entry>& grids, const std::string& name) {
  const Entry* chosen = nullptr;
  const std::string wanted = !name.empty() ? name : grids.size() == 1 ? grids[0].name : "density";
  for (const Entry& entry : grids) {
    if (entry.name != wanted) continue;
    if (chosen != nullptr)
      return input_error("the file holds two grids named '" + printable(wanted) + "'").with_field("grid");
    chosen = &entry;
  }
  if (chosen != nullptr) return chosen;
  return input_error((name.empty() ? std::string("the file holds several grids and none is named 'density'")
                                   : "the file holds no grid named '" + printable(name) + "'") +
                     ": there is " + listed(grids))
      .with_field("grid");
}

// Two pieces of memory one after the other.
class Pieces : public std::streambuf {
 public:
  Pieces(std::string_view first, std::string_view second) : second_(second) { show(first); }

 protected:
  int_type underflow() override {
    if (gptr() == egptr()) {
      if (second_.empty()) return traits_type::eof();
      show(std::exchange(second_, {}));
    }
    return traits_type::to_int_type(*gptr());
  }

 private:
  void show(std::string_view piece) {
    char* start = const_cast<char*>(piece.data());  // the base class wants it so; nothing writes
    setg(start, start, start + piece.size());
  }
  std::string_view second_;
};

Result<openvdb::GridBase::Ptr> parse(const Directory& directory, const Entry& entry,
                                     std::uint64_t value_bytes) {
  const Error damaged = input_error("the OpenVDB file is cut short or damaged");
  Walk walk{entry.body};
  const auto compression = walk.number<std::uint32_t>();
  bool half = false;
  skip_metadata(walk, &half);
  if (!walk.ok || half != entry.half || compression > 7) return damaged;
  const std::string_view rest = entry.body.substr(walk.at);
  const std::string_view map = walk.text();
  const std::uint64_t map_bytes = bytes_of_map(map);
  if (walk.ok && map_bytes == 0) {
    return input_error("the OpenVDB grid's transform is of type '" + printable(map) +
                       "', which is not supported (linear ones are)");
  }
  walk.take(map_bytes);
  vdb::check_tree(walk,
                  {compression, value_bytes, half ? value_bytes / (value_bytes == 8 ? 4 : 2) : value_bytes});
  if (!walk.ok) return damaged;

  // A file of this grid alone: the header, no metadata of the file, one grid, none of its metadata but one.
  std::string front(directory.header);
  const auto append = [&](std::uint32_t number) {
    front.append(reinterpret_cast<const char*>(&number), sizeof number);
  };
  append(0);
  append(1);
  front.append(entry.descriptor);
  append(compression);
  append(half ? 1 : 0);
  if (half) {
    for (const std::string_view text : {"is_saved_as_half_float", "bool", "\x01"}) {
      append(static_cast<std::uint32_t>(text.size()));
      front.append(text);
    }
  }
  Pieces pieces(front, rest);
  std::istream in(&pieces);
  // OpenVDB seldom asks whether a read succeeded, and would go on with what was in memory before.
  in.exceptions(std::ios::failbit | std::ios::badbit | std::ios::eofbit);
  openvdb::io::Stream stream(in, /*delayLoad=*/false);
  const auto grids = stream.getGrids();
  if (grids == nullptr || grids->empty() || grids->front()->type() != entry.type) return damaged;
  return grids->front();
}

// The box of cells in the world, for which axes must stay axes.
std::optional<Error> place_box(const openvdb::GridBase& grid, const openvdb::CoordBBox& box,
                               VolumeData& volume) {
  const auto fail = [](const char* why) {
    return input_error(std::string("the OpenVDB grid's transform ") + why)
        .with_field("use_grid_bbox")
        .with_mend("leave it out and place the grid with to_world");
  };
  const openvdb::Mat4d m =
      grid.transform().baseMap()->getAffineMap()->getMat4();  // of rows: world = index * m
  float low[3], high[3];
  for (int axis = 0; axis < 3; ++axis) {
    const double scale = m(axis, axis);
    for (int other = 0; other < 3; ++other)
      if (other != axis && !(std::abs(m(axis, other)) <= 1e-9 * std::abs(scale)))
        return fail("turns or shears the axes");
    if (!(scale > 0)) return fail("mirrors or flattens an axis");
    low[axis] = static_cast<float>((box.min()[axis] - 0.5) * scale + m(3, axis));
    high[axis] = static_cast<float>((box.max()[axis] + 0.5) * scale + m(3, axis));
  }
  volume.low = {low[0], low[1], low[2]};
  volume.high = {high[0], high[1], high[2]};
  return std::nullopt;
}

template <class Value>
void put(float* to, const Value& value) {
  if constexpr (std::is_arithmetic_v<Value>) {
    to[0] = static_cast<float>(value);
  } else {
    for (int i = 0; i < 3; ++i) to[i] = value[i];
  }
}

template <class Grid>
Result<VolumeData> densify(const Grid& grid, const VdbChoice& choice) {
  VolumeData volume;
  volume.channels = std::is_arithmetic_v<typename Grid::ValueType> ? 1 : 3;
  openvdb::CoordBBox box;
  if (!grid.tree().evalActiveVoxelBoundingBox(box))
    return input_error("the OpenVDB grid has no active voxel");
  std::uint64_t count = volume.channels;
  for (int axis = 0; axis < 3; ++axis) {
    const std::int64_t size = std::int64_t{box.max()[axis]} - box.min()[axis] + 1;
    if (size < 1) return input_error("the OpenVDB grid is out of the range of indices");
    volume.size[static_cast<std::size_t>(axis)] = static_cast<std::uint32_t>(size);
    if (static_cast<std::uint64_t>(size) > choice.most_values / count) {
      return input_error("the box around the OpenVDB grid's active voxels holds more than " +
                         std::to_string(choice.most_values) + " values")
          .with_mend("resample the grid more coarsely, or remove stray voxels far from the rest");
    }
    count *= static_cast<std::uint64_t>(size);
  }
  if (choice.place) {
    if (auto error = place_box(grid, box, volume)) return *std::move(error);
  }
  volume.values.resize(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < volume.values.size(); i += volume.channels)
    put(&volume.values[i], grid.background());
  std::size_t step = 0;
  for (auto it = grid.tree().cbeginValueOn(); it; ++it) {
    if (choice.step != nullptr && (step++ & 1023) == 0) choice.step();
    openvdb::CoordBBox run = it.getBoundingBox();  // of a voxel, or of a tile of them
    run.intersect(box);
    for (std::int64_t z = run.min().z(); z <= run.max().z(); ++z)
      for (std::int64_t y = run.min().y(); y <= run.max().y(); ++y)
        for (std::int64_t x = run.min().x(); x <= run.max().x(); ++x) {
          const auto i = static_cast<std::size_t>(
              ((z - box.min().z()) * volume.size[1] + (y - box.min().y())) * volume.size[0] +
              (x - box.min().x()));
          put(&volume.values[i * volume.channels], *it);
        }
  }
  for (std::size_t i = 0; i < volume.values.size(); ++i) {
    const float value = volume.values[i];
    if (!(value >= 0) || !std::isfinite(value)) {
      return input_error("value " + std::to_string(i) + " of the volume is " +
                         (std::isfinite(value) ? "negative" : "not finite"));
    }
  }
  return volume;
}

Result<VolumeData> load(std::string_view bytes, const VdbChoice& choice) {
  CANDELA_ASSIGN(const Directory directory, read_directory(bytes));
  CANDELA_ASSIGN(const Entry* entry, choose(directory.grids, choice.grid));
  const std::string quoted = "'" + printable(entry->name) + "'";
  if (entry->instance) {
    return input_error("grid " + quoted + " of the OpenVDB file shares another one's tree")
        .with_mend("write it with instancing disabled");
  }
  const bool of_floats = entry->type == openvdb::FloatGrid::gridType(),
             of_doubles = entry->type == openvdb::DoubleGrid::gridType();
  if (!of_floats && !of_doubles && entry->type != openvdb::Vec3SGrid::gridType()) {
    return input_error("grid " + quoted + " of the OpenVDB file is of type '" + printable(entry->type) +
                       "', which is not supported (" + openvdb::FloatGrid::gridType() + ", " +
                       openvdb::DoubleGrid::gridType() + " and " + openvdb::Vec3SGrid::gridType() + " are)");
  }
  openvdb::initialize();
  CANDELA_ASSIGN(const openvdb::GridBase::Ptr grid, parse(directory, *entry,
                                                          of_floats    ? sizeof(float)
                                                          : of_doubles ? sizeof(double)
                                                                       : 12));
  if (of_floats) return densify(*openvdb::gridPtrCast<openvdb::FloatGrid>(grid), choice);
  if (of_doubles) return densify(*openvdb::gridPtrCast<openvdb::DoubleGrid>(grid), choice);
  return densify(*openvdb::gridPtrCast<openvdb::Vec3SGrid>(grid), choice);
}

Result<VolumeData> load_named(std::string_view bytes, const std::string& name, const VdbChoice& choice) {
  const auto fail = [&](Error error) { return std::move(error).at(name, 0); };
  try {
    Result<VolumeData> volume = load(bytes, choice);
    if (!volume.ok()) return fail(std::move(volume.error()));
    return volume;
  } catch (const std::bad_alloc&) {
    return fail(input_error("the OpenVDB file asks for more memory than there is"));
  } catch (const std::ios_base::failure&) {
    return fail(input_error("the OpenVDB file is cut short or damaged"));
  } catch (const std::exception& error) {
    return fail(input_error("OpenVDB cannot read the file: " + printable(error.what())));
  } catch (const WorkStopped&) {
    throw;
  } catch (...) {
    return fail(input_error("OpenVDB cannot read the file"));
  }
}

}  // namespace
}  // namespace candela::loaders

extern "C" void candela_load_vdb_1(std::string_view bytes, const std::string& name,
                                   const candela::loaders::VdbChoice& choice,
                                   candela::Result<candela::loaders::VolumeData>& volume) {
  volume = candela::loaders::load_named(bytes, name, choice);
}
