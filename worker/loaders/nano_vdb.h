// NanoVDB's sparse grids of floats, as pbrt scenes have them.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "worker/loaders/volume.h"

namespace candela::loaders {

// True if the bytes start as a file of NanoVDB does.
inline bool is_nano_vdb(std::string_view bytes) {
  return bytes.starts_with("NanoVDB");
}

// The grid of this name (empty: the file's first) as one dense channel. Files of the version 32, not
// compressed or by ZIP; the box around the active voxels is the grid, of `most_values` at most. A voxel is a
// cell whose center is at the voxel's index, so that low and high reach half a voxel further. The grid's
// transform may scale and move, not turn or shear. `name` goes into errors.
Result<VolumeData> load_nano_vdb(std::string_view bytes, const std::string& name, const std::string& grid,
                                 std::uint64_t most_values = std::uint64_t{1} << 30);

}  // namespace candela::loaders
