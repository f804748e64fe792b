// Quantities that vary in space: a constant, or values on a grid.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string_view>

#include "common/base/result.h"
#include "common/description/object.h"
#include "worker/core/vec.h"
#include "worker/loaders/volume.h"

namespace candela::scene {

// A grid in space. Its cells fill the unit cube [0, 1]^3 of local space, values sit at their centers;
// to_world places the cube.
class GridVolume {
 public:
  enum class Wrap : std::uint8_t { clamp, repeat, mirror, zero };

  // From a description object "gridvolume".
  static Result<GridVolume> build(const description::Object& object, const description::FileSource& files);

  // In double: a ray's point must fall on the same side of a cell's wall however it was found.
  Vec3d to_local(Vec3d world) const {
    return {dot(rows_[0], world) + offset_[0], dot(rows_[1], world) + offset_[1],
            dot(rows_[2], world) + offset_[2]};
  }
  Vec3d to_local_vector(Vec3d v) const { return {dot(rows_[0], v), dot(rows_[1], v), dot(rows_[2], v)}; }

  // Anywhere in local space; beyond the outermost centers as wrap_mode says.
  Spectrum eval(Vec3d local) const;
  bool gray() const { return data_.channels == 1; }

  // Bounds of eval over a box of [0, 1]^3, per channel; not always tight.
  void bounds(Vec3d low, Vec3d high, Spectrum& least, Spectrum& most) const;
  Spectrum maximum() const;
  // No line in the world is longer inside the grid.
  double longest_line() const;
  const std::array<std::uint32_t, 3>& size() const { return data_.size; }

 private:
  // Multiplies all values.
  void scale(Spectrum factor);
  std::int64_t wrapped(std::int64_t i, int axis) const;                 // -1: outside, where values are 0
  Spectrum cell(std::int64_t x, std::int64_t y, std::int64_t z) const;  // wrapped already

  loaders::VolumeData data_;
  bool nearest_ = false;
  Wrap wrap_ = Wrap::clamp;
  std::array<Vec3d, 3> rows_{};  // world to local
  std::array<double, 3> offset_{};
};

// Constant, or a grid.
struct Volume {
  // A parameter that may be a volume.
  static Result<Volume> build(const description::Object& owner, std::string_view name, double otherwise,
                              const description::FileSource& files);
  Spectrum constant;
  std::shared_ptr<const GridVolume> grid;  // null: the constant
  Spectrum eval(Vec3d world) const { return grid == nullptr ? constant : grid->eval(grid->to_local(world)); }
  Spectrum maximum() const { return grid == nullptr ? constant : grid->maximum(); }
};

}  // namespace candela::scene
