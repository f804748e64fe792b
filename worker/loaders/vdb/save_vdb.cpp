// Writes OpenVDB's files.
#include <openvdb/io/Archive.h>
#include <openvdb/openvdb.h>

#include <array>
#include <cstdint>
#include <sstream>

#include "worker/loaders/vdb/volume_vdb.h"

namespace candela::loaders {
namespace {

// OpenVDB's writer of files, onto a stream that can seek.
class Archive : public openvdb::io::Archive {
 public:
  using openvdb::io::Archive::write;
};

float luminance_of(const float* v) {
  return luminance({v[0], v[1], v[2]});
}

template <class Grid, class ValueAt>
typename Grid::Ptr grid_of(const VolumeData& volume, const char* name, const ValueAt& value_at) {
  using Value = typename Grid::ValueType;
  typename Grid::Ptr grid = Grid::create(Value(0));
  grid->setName(name);
  const std::array<double, 3> low = {volume.low.x, volume.low.y, volume.low.z},
                              high = {volume.high.x, volume.high.y, volume.high.z};
  openvdb::Mat4d transform = openvdb::Mat4d::identity();  // of rows: world = index * transform
  for (int a = 0; a < 3; ++a) {
    const auto axis = static_cast<std::size_t>(a);
    const double cell = (high[axis] - low[axis]) / volume.size[axis];
    transform(a, a) = cell;
    transform(3, a) = low[axis] + cell / 2;
  }
  grid->setTransform(openvdb::math::Transform::createLinearTransform(transform));
  auto accessor = grid->getAccessor();
  std::size_t cell = 0;
  const std::size_t last = volume.values.size() / volume.channels - 1;
  for (std::uint32_t z = 0; z < volume.size[2]; ++z)
    for (std::uint32_t y = 0; y < volume.size[1]; ++y)
      for (std::uint32_t x = 0; x < volume.size[0]; ++x, ++cell) {
        const Value value = value_at(&volume.values[cell * volume.channels]);
        if (value == Value(0) && cell != 0 && cell != last) continue;
        accessor.setValueOn({static_cast<int>(x), static_cast<int>(y), static_cast<int>(z)}, value);
      }
  return grid;
}

Result<std::string> save(const VolumeData& volume) {
  openvdb::initialize();
  openvdb::GridCPtrVec grids;
  if (volume.channels == 3) {
    grids.push_back(grid_of<openvdb::FloatGrid>(volume, "density", luminance_of));
    const auto color_grid = grid_of<openvdb::Vec3SGrid>(
        volume, "color", [](const float* v) { return openvdb::Vec3s(v[0], v[1], v[2]); });
    color_grid->setVectorType(openvdb::VEC_INVARIANT);
    grids.push_back(color_grid);
  } else {
    grids.push_back(grid_of<openvdb::FloatGrid>(volume, "density", [](const float* v) { return *v; }));
  }
  Archive archive;
  archive.setCompression(openvdb::io::COMPRESS_ZIP | openvdb::io::COMPRESS_ACTIVE_MASK);
  std::ostringstream out;
  archive.write(out, grids, /*seekable=*/true);
  if (!out) return resource_error("the OpenVDB file does not fit into memory");
  return std::move(out).str();
}

}  // namespace
}  // namespace candela::loaders

extern "C" void candela_save_vdb_1(const candela::loaders::VolumeData& volume,
                                   candela::Result<std::string>& bytes) {
  try {
    bytes = candela::loaders::save(volume);
  } catch (const std::bad_alloc&) {
    bytes = candela::resource_error("out of memory while the OpenVDB file was made");
  } catch (const std::exception& e) {
    bytes = candela::input_error(std::string("OpenVDB cannot write the volume: ") + e.what());
  }
}
