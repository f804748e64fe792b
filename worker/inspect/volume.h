// The light of some pixels in space: each path brings its contribution to the cells of a box that its edges
// cross [Kaplanyan 2017, 9.1.1.4].
//
// A cell's value is sum(contribution * length in the cell) / volume of the cell, of the contributions to the
// mean pixel. So a beam of cross-section A that brings the mean pixel the radiance L has the value L / A
// along its way, and the sum of value * volume over a slab across the beam is L times the slab's thickness.
#pragma once

#include <cstdint>

#include "common/base/result.h"
#include "worker/inspect/cell_sums.h"
#include "worker/inspect/session.h"
#include "worker/integrators/volume/cell_grid.h"
#include "worker/loaders/volume.h"

namespace candela::inspect {

using integrators::CellGrid;

struct VolumeRequest {
  PixelRect pixels;
  CellGrid grid;  // in the coordinates of the scene's file
  std::uint64_t spp = 16;
  bool eye_edges = false;  // also the last edge of each path, to the eye
  unsigned threads = 1;
};

struct VolumeReport {
  Vec3d mean = {};          // of a pixel, of the light that is selected
  Vec3d crossing = {};      // the part of it whose paths cross the box, edges to the eye as in the request
  std::uint64_t paths = 0;  // contributions of that part
  std::uint64_t not_finite = 0;  // contributions left out
  std::uint64_t too_large = 0;   // contributions that a cell's sum could not take
  // Sum 3 * cell + channel: of contribution * 2^scale_log2 * length / unit over pixels and samples. Requests
  // that differ in the selection alone have the same scale.
  CellSums sums;
  double unit = 1;  // shortest edge of a cell
  int scale_log2 = 0;
};

// Memory that inspect_volume() and volume_data() of such a grid take.
std::uint64_t volume_bytes(const CellGrid& grid);

// A pure function of session and request but for threads, which change nothing. Errors: settings of the
// integrator; (resource) memory.
Result<VolumeReport> inspect_volume(const Session& session, const VolumeRequest& request);

// The values of the cells, three channels. Gives the report's sums back. Errors: a value is beyond a float.
Result<loaders::VolumeData> volume_data(const VolumeRequest& request, VolumeReport& report);

}  // namespace candela::inspect
