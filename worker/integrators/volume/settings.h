// Settings of the jobs of `candela inspect volume`: those of recorded paths, and the cells.
#pragma once

#include "worker/integrators/volume/cell_grid.h"
#include "worker/integrators/volume/recorded_settings.h"

namespace candela::integrators {

struct VolumeSettings {
  RecordedSettings recorded;
  // In the coordinates of the scene's file.
  double low_x = 0, low_y = 0, low_z = 0, high_x = 1, high_y = 1, high_z = 1;
  int cells_x = 1, cells_y = 1, cells_z = 1;
  bool eye_edges = false;

  template <class Visitor>
  void fields(Visitor& visit) {
    constexpr double most = 1e30;
    constexpr int extent = Limits::max_extent;
    recorded.fields(visit);
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
};

}  // namespace candela::integrators
