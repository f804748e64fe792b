// Settings of the jobs of `candela inspect paths`: those of recorded paths, and which of them count.
#pragma once

#include <optional>

#include "common/letters/request.h"
#include "worker/integrators/volume/recorded_settings.h"

namespace candela::integrators {

// Pixels of the film, which has one row. Iteration i of the job is in batch i mod kShareBatches.
inline constexpr std::uint32_t kShareBatches = 32;

struct SharesSettings {
  RecordedSettings recorded;
  // The region of the vertex next to the eye, in the coordinates of the scene's file.
  Choice spot{"none", {"none", "box", "sphere"}};
  double low_x = 0, low_y = 0, low_z = 0, high_x = 0, high_y = 0, high_z = 0, radius = 0;
  bool selects = false;

  template <class Visitor>
  void fields(Visitor& visit) {
    constexpr double most = 1e30;
    recorded.fields(visit);
    visit("spot", spot, "kind of the region that the vertex next to the eye is in");
    visit("low_x", low_x, {-most, most}, "lower corner of the box, or center of the sphere");
    visit("low_y", low_y, {-most, most}, "lower corner of the box, or center of the sphere");
    visit("low_z", low_z, {-most, most}, "lower corner of the box, or center of the sphere");
    visit("high_x", high_x, {-most, most}, "upper corner of the box");
    visit("high_y", high_y, {-most, most}, "upper corner of the box");
    visit("high_z", high_z, {-most, most}, "upper corner of the box");
    visit("radius", radius, {0, most}, "of the sphere");
    visit("selects", selects, "the first layer selects: the others have light of the first alone");
  }

  std::optional<letters::Region> region() const {
    if (spot.value == "none") return std::nullopt;
    letters::Region region;
    region.kind = spot.value == "box" ? letters::Region::Kind::box : letters::Region::Kind::sphere;
    region.low = {low_x, low_y, low_z};
    region.high = {high_x, high_y, high_z};
    region.radius = radius;
    return region;
  }
};

}  // namespace candela::integrators
