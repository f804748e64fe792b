// OpenVDB's sparse grids, where Candela was built with OpenVDB (candela_render is compiled with
// CANDELA_OPENVDB then).
#pragma once

#include <string>
#include <string_view>

#include "common/base/result.h"
#include "worker/loaders/volume.h"

namespace candela::loaders {

// True if the bytes start as OpenVDB's files do.
inline bool is_vdb(std::string_view bytes) {
  return bytes.starts_with(std::string_view(" BDV\0\0\0\0", 8));
}

struct VdbChoice {
  std::string grid;  // by name; empty: the file's only grid, else "density"
  bool place;        // whether low and high are wanted, which not every file's transform can give
  // Two active voxels far apart claim a huge box in a small file; 4 GiB of values is the limit.
  std::uint64_t most_values = std::uint64_t{1} << 30;
  void (*step)() = nullptr;  // work_step() of the program that loads the module
};

// One grid of floats or doubles (1 channel) or float vectors (3), also where stored as halves. The smallest
// box around the active voxels becomes dense; what is not active in it has the grid's background value. A
// voxel is a cell whose center is at the voxel's integer index, so the box in the world reaches half a voxel
// further than the outermost indices. `name` goes into errors.
//
// Every length in the file and every compressed block's header is checked here before OpenVDB parses the
// grid, which trusts them. An error in there is caught; a crash would not be.
Result<VolumeData> load_vdb(std::string_view bytes, const std::string& name, const VdbChoice& choice);

// A file with a grid `density` of floats, the luminance, and for three channels a grid `color` of float
// vectors. Cells of value 0 are not active, but for the two at the corners of the box, which the box of
// active voxels then is. Equal volumes give equal bytes.
Result<std::string> encode_vdb(const VolumeData& volume);

}  // namespace candela::loaders

// The same in the module of OpenVDB's files (base/module.h).
extern "C" void candela_load_vdb_1(std::string_view bytes, const std::string& name,
                                   const candela::loaders::VdbChoice& choice,
                                   candela::Result<candela::loaders::VolumeData>& volume);
extern "C" void candela_save_vdb_1(const candela::loaders::VolumeData& volume,
                                   candela::Result<std::string>& bytes);
