#include "worker/scene/media/volume.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "common/base/log.h"
#include "worker/loaders/nano_vdb.h"
#include "worker/loaders/pbrt_grid.h"
#include "worker/loaders/vdb/volume_vdb.h"
#include "worker/scene/transform.h"

namespace candela::scene {
namespace {

constexpr std::uint64_t kMaxValues = std::uint64_t{1} << 30;

// Maximum distance by which rounding moves a point over a cell's wall, in cells.
constexpr double kSlack = 1e-6;

Spectrum mix(Spectrum a, Spectrum b, float t) {
  return a * (1 - t) + b * t;
}

}  // namespace

Result<GridVolume> GridVolume::build(const description::Object& object,
                                     const description::FileSource& files) {
  const auto fail = [&](std::string message) {
    return input_error(std::move(message)).at(object.where.file, object.where.line);
  };
  const std::string file = object.get_string("filename", ""), name = object.get_string("grid", "");
  const bool in_box = object.get_bool("use_grid_bbox", false);
  CANDELA_ASSIGN(const description::FileSource::Bytes bytes, files.open(file));
  description::ReadingBudget& budget = files.budget();
  // A few voxels far apart make a small file a large grid.
  const std::uint64_t most = std::min(kMaxValues, budget.left() / sizeof(float));
  const auto within_budget = [&](Result<loaders::VolumeData> read) -> Result<loaders::VolumeData> {
    if (!read.ok() && most < kMaxValues && read.error().message.starts_with("the box around"))
      return budget.refusal(object.where, "the values of '" + file + "'", (most + 1) * sizeof(float));
    return read;
  };
  GridVolume grid;
  if (object.find("offset") != nullptr) {
    CANDELA_ASSIGN(grid.data_,
                   loaders::load_pbrt_grid(bytes.view, file, object.get_integer("offset", 0),
                                           object.where.file == file ? object.where.line : 1, name, budget));
  } else if (loaders::is_nano_vdb(bytes.view)) {
    CANDELA_ASSIGN(grid.data_, within_budget(loaders::load_nano_vdb(bytes.view, file, name, most)));
  } else if (loaders::is_vdb(bytes.view)) {
#ifdef CANDELA_OPENVDB
    CANDELA_ASSIGN(grid.data_, within_budget(loaders::load_vdb(
                                   bytes.view, file, {.grid = name, .place = in_box, .most_values = most})));
#else
    return fail("this build of Candela does not read OpenVDB files: '" + file + "'")
        .with_field("filename")
        .with_mend("install libopenvdb-dev and build again, or convert the file to Mitsuba's .vol format");
#endif
  } else if (!name.empty()) {
    return fail("only OpenVDB and NanoVDB files have grids with names, and '" + file + "' is none")
        .with_field("grid");
  } else if (file.ends_with(".vdb")) {
    return fail("'" + file + "' is not an OpenVDB file: it does not start as one").with_field("filename");
  } else if (file.ends_with(".nvdb")) {
    return fail("'" + file + "' is not a NanoVDB file: it does not start as one").with_field("filename");
  } else {
    CANDELA_ASSIGN(grid.data_, loaders::load_volume(bytes.view, file));
    if (grid.data_.negative_count > 0) {
      log::warn(object.where.file + ":" + std::to_string(object.where.line) + ": " +
                std::to_string(grid.data_.negative_count) + " negative values of '" + file + "' became 0");
    }
  }
  // For good: the budget ends with the reading.
  CANDELA_TRY(budget.charge(grid.data_.values.size() * sizeof(float), object.where, "grids of volumes"));
  if (const auto factor = object.get_rgb("factor")) {
    const auto& v = factor->value;
    grid.scale({static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])});
    for (const float value : grid.data_.values)
      if (!std::isfinite(value))
        return fail("values of '" + file + "' times the factor are too large").with_field("factor");
  }
  grid.nearest_ = object.get_string("filter_type", "trilinear") == "nearest";
  const std::string wrap = object.get_string("wrap_mode", "clamp");
  grid.wrap_ = wrap == "repeat"   ? Wrap::repeat
               : wrap == "mirror" ? Wrap::mirror
               : wrap == "zero"   ? Wrap::zero
                                  : Wrap::clamp;

  const Transform to_world(object.get_transform("to_world"));
  const double determinant = to_world.determinant();
  // Rows of the inverse are the cross products of the columns over the determinant.
  const Vec3d a = to_world.column(0), b = to_world.column(1), c = to_world.column(2);
  grid.rows_ = {cross(b, c) / determinant, cross(c, a) / determinant, cross(a, b) / determinant};
  for (std::size_t i = 0; i < 3; ++i) grid.offset_[i] = -dot(grid.rows_[i], to_world.translation());
  if (in_box) {
    const Vec3d low(grid.data_.low), extent = Vec3d(grid.data_.high) - low;
    for (int i = 0; i < 3; ++i) {
      if (!(extent[i] > 0) || !std::isfinite(extent[i]))
        return fail("the bounding box in '" + file + "' has no volume").with_field("use_grid_bbox");
      const auto k = static_cast<std::size_t>(i);
      grid.rows_[k] = grid.rows_[k] / extent[i];
      grid.offset_[k] = (grid.offset_[k] - low[i]) / extent[i];
    }
  }
  for (std::size_t i = 0; i < 3; ++i) {
    if (!std::isfinite(length_squared(grid.rows_[i])) || !std::isfinite(grid.offset_[i]))
      return fail("the to_world of the volume is out of range").with_field("to_world");
  }
  return grid;
}

void GridVolume::scale(Spectrum factor) {
  const bool is_gray = factor.r == factor.g && factor.g == factor.b;
  if (data_.channels == 1 && !is_gray) {
    std::vector<float> colors(3 * data_.values.size());
    for (std::size_t i = 0; i < colors.size(); ++i) colors[i] = data_.values[i / 3];
    data_.values = std::move(colors);
    data_.channels = 3;
  }
  const float factors[3] = {factor.r, factor.g, factor.b};
  for (std::size_t i = 0; i < data_.values.size(); ++i) data_.values[i] *= factors[i % data_.channels];
}

std::int64_t GridVolume::wrapped(std::int64_t i, int axis) const {
  const auto n = static_cast<std::int64_t>(data_.size[static_cast<std::size_t>(axis)]);
  if (i >= 0 && i < n) return i;
  switch (wrap_) {
    case Wrap::clamp:
      return std::clamp<std::int64_t>(i, 0, n - 1);
    case Wrap::zero:
      return -1;
    case Wrap::repeat:
      return ((i % n) + n) % n;
    case Wrap::mirror: {
      const std::int64_t j = ((i % (2 * n)) + 2 * n) % (2 * n);
      return j < n ? j : 2 * n - 1 - j;
    }
  }
  return 0;
}

Spectrum GridVolume::cell(std::int64_t x, std::int64_t y, std::int64_t z) const {
  if ((x | y | z) < 0) return Spectrum(0.0f);
  const std::size_t i =
      (static_cast<std::size_t>(z) * data_.size[1] + static_cast<std::size_t>(y)) * data_.size[0] +
      static_cast<std::size_t>(x);
  if (data_.channels == 1) return Spectrum(data_.values[i]);
  return {data_.values[3 * i], data_.values[3 * i + 1], data_.values[3 * i + 2]};
}

Spectrum GridVolume::eval(Vec3d local) const {
  std::array<std::int64_t, 3> low{}, high{};
  std::array<float, 3> t{};
  for (int axis = 0; axis < 3; ++axis) {
    const auto k = static_cast<std::size_t>(axis);
    // Points of a medium lie in its shape; what is far away needs an answer, but no exact one.
    const double x = std::clamp(local[axis] * data_.size[k] - (nearest_ ? 0.0 : 0.5), -1e15, 1e15);
    const double floor = std::floor(x);
    low[k] = wrapped(static_cast<std::int64_t>(floor), axis);
    if (nearest_) continue;
    high[k] = wrapped(static_cast<std::int64_t>(floor) + 1, axis);
    t[k] = static_cast<float>(x - floor);
  }
  if (nearest_) return cell(low[0], low[1], low[2]);
  const auto row = [&](std::int64_t y, std::int64_t z) {
    return mix(cell(low[0], y, z), cell(high[0], y, z), t[0]);
  };
  return mix(mix(row(low[1], low[2]), row(high[1], low[2]), t[1]),
             mix(row(low[1], high[2]), row(high[1], high[2]), t[1]), t[2]);
}

void GridVolume::bounds(Vec3d low, Vec3d high, Spectrum& least, Spectrum& most) const {
  std::array<std::int64_t, 3> first{}, last{};
  for (int axis = 0; axis < 3; ++axis) {
    const auto k = static_cast<std::size_t>(axis);
    const double n = data_.size[k], shift = nearest_ ? 0.0 : 0.5;
    first[k] = static_cast<std::int64_t>(std::floor(low[axis] * n - shift - kSlack));
    last[k] = static_cast<std::int64_t>(std::floor(high[axis] * n - shift + kSlack)) + (nearest_ ? 0 : 1);
  }
  least = Spectrum(3e38f);
  most = Spectrum(0.0f);
  for (std::int64_t z = first[2]; z <= last[2]; ++z)
    for (std::int64_t y = first[1]; y <= last[1]; ++y)
      for (std::int64_t x = first[0]; x <= last[0]; ++x) {
        const Spectrum value = cell(wrapped(x, 0), wrapped(y, 1), wrapped(z, 2));
        least = min(least, value);
        most = max(most, value);
      }
}

double GridVolume::longest_line() const {
  const double determinant = std::abs(dot(rows_[0], cross(rows_[1], rows_[2])));
  double edges = 0;
  for (std::size_t i = 0; i < 3; ++i) edges += length(cross(rows_[(i + 1) % 3], rows_[(i + 2) % 3]));
  return edges / determinant;
}

Spectrum GridVolume::maximum() const {
  Spectrum most;
  for (std::size_t i = 0; i < data_.values.size(); i += data_.channels) {
    const Spectrum value = data_.channels == 1
                               ? Spectrum(data_.values[i])
                               : Spectrum(data_.values[i], data_.values[i + 1], data_.values[i + 2]);
    most = max(most, value);
  }
  return most;
}

Result<Volume> Volume::build(const description::Object& owner, std::string_view name, double otherwise,
                             const description::FileSource& files) {
  std::optional<description::Rgb> rgb = owner.get_rgb(name);
  Volume volume;
  if (const description::Child* child = owner.find_child(name)) {
    if (child->object->plugin == "gridvolume") {
      CANDELA_ASSIGN(GridVolume grid, GridVolume::build(*child->object, files));
      volume.grid = std::make_shared<const GridVolume>(std::move(grid));
      return volume;
    }
    rgb = child->object->get_rgb("value");
    otherwise = 1;
  }
  const description::Vec3 value = rgb ? rgb->value : description::Vec3{otherwise, otherwise, otherwise};
  volume.constant = {static_cast<float>(value[0]), static_cast<float>(value[1]),
                     static_cast<float>(value[2])};
  return volume;
}

}  // namespace candela::scene
