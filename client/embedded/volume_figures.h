// Figures of `candela inspect volume`: a grid as pictures, through a color map with a scale.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/image/false_color.h"
#include "worker/loaders/volume.h"

namespace candela::client {

struct VolumePictures {
  std::size_t axis = 2;  // 0 to 2: x, y, z
  image::ColorMap map = image::ColorMap::viridis;
  bool logarithmic = false;
};

// Luminances of a picture, row by row from the top. Seen along z: x to the right, y up; along y: x to the
// right, z down; along x: z to the right, y up.
struct VolumePicture {
  std::uint32_t width = 0, height = 0;
  std::vector<float> values;
};
// The mean of all slices across the axis.
VolumePicture project_volume(const loaders::VolumeData& volume, std::size_t axis);
VolumePicture slice_volume(const loaders::VolumeData& volume, std::size_t axis, std::uint32_t slice);

image::Figure draw_projection(const loaders::VolumeData& volume, const VolumePictures& pictures);
// Up to 16 slices at equal distances, in rows from the top, the lowest coordinate first.
image::Figure draw_slices(const loaders::VolumeData& volume, const VolumePictures& pictures);

}  // namespace candela::client
