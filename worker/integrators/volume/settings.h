// Settings of the jobs of `candela inspect volume`: those of bidirectional paths, the camera's film, its
// pixels whose light is taken, and the cells.
#pragma once

#include "worker/integrators/bdpt/settings.h"
#include "worker/integrators/volume/cell_grid.h"
#include "worker/integrators/volume/recorded_path.h"

namespace candela::integrators {

struct VolumeSettings {
  BdptSettings bdpt;
  // The film, and its place in a larger image, if it is part of one: common/job/tools.h.
  int film_width = 1, film_height = 1, crop_x = 0, crop_y = 0, whole_width = 0, whole_height = 0;
  int pixel_x0 = 0, pixel_y0 = 0, pixel_x1 = 0, pixel_y1 = 0;  // both corners included
  // In the coordinates of the scene's file.
  double low_x = 0, low_y = 0, low_z = 0, high_x = 1, high_y = 1, high_z = 1;
  int cells_x = 1, cells_y = 1, cells_z = 1;
  bool eye_edges = false;

  template <class Visitor>
  void fields(Visitor& visit) {
    constexpr double most = 1e30;
    constexpr int extent = Limits::max_extent;
    bdpt.fields(visit);
    visit("film_width", film_width, 1, extent, "pixels of the image");
    visit("film_height", film_height, 1, extent, "pixels of the image");
    visit("crop_x", crop_x, 0, extent, "left pixel of the image in a larger one");
    visit("crop_y", crop_y, 0, extent, "top pixel of the image in a larger one");
    visit("whole_width", whole_width, 0, extent, "pixels of the larger image; 0: there is none");
    visit("whole_height", whole_height, 0, extent, "pixels of the larger image; 0: there is none");
    visit("pixel_x0", pixel_x0, 0, extent, "left pixel whose light is taken");
    visit("pixel_y0", pixel_y0, 0, extent, "top pixel whose light is taken");
    visit("pixel_x1", pixel_x1, 0, extent, "right pixel whose light is taken");
    visit("pixel_y1", pixel_y1, 0, extent, "bottom pixel whose light is taken");
    visit("low_x", low_x, {-most, most}, "lower corner of the box");
    visit("low_y", low_y, {-most, most}, "lower corner of the box");
    visit("low_z", low_z, {-most, most}, "lower corner of the box");
    visit("high_x", high_x, {-most, most}, "upper corner of the box");
    visit("high_y", high_y, {-most, most}, "upper corner of the box");
    visit("high_z", high_z, {-most, most}, "upper corner of the box");
    visit("cells_x", cells_x, 1, extent, "cells along x");
    visit("cells_y", cells_y, 1, extent, "cells along y");
    visit("cells_z", cells_z, 1, extent, "cells along z");
    visit("eye_edges", eye_edges, "the last edge of each path, to the eye, counts");
  }

  CellGrid grid() const {
    return {{low_x, low_y, low_z},
            {high_x, high_y, high_z},
            {static_cast<std::uint32_t>(cells_x), static_cast<std::uint32_t>(cells_y),
             static_cast<std::uint32_t>(cells_z)}};
  }
  PixelRect pixels() const {
    return {static_cast<std::uint32_t>(pixel_x0), static_cast<std::uint32_t>(pixel_y0),
            static_cast<std::uint32_t>(pixel_x1), static_cast<std::uint32_t>(pixel_y1)};
  }
};

}  // namespace candela::integrators
