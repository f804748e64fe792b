// Settings of jobs whose units record paths: those of bidirectional paths, the camera's film, and its pixels
// whose light is taken.
#pragma once

#include "worker/integrators/bdpt/settings.h"
#include "worker/integrators/volume/recorded_path.h"

namespace candela::integrators {

struct RecordedSettings {
  BdptSettings bdpt;
  // The film, and its place in a larger image, if it is part of one: common/job/tools.h.
  int film_width = 1, film_height = 1, crop_x = 0, crop_y = 0, whole_width = 0, whole_height = 0;
  int pixel_x0 = 0, pixel_y0 = 0, pixel_x1 = 0, pixel_y1 = 0;  // both corners included

  template <class Visitor>
  void fields(Visitor& visit) {
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
  }

  PixelRect pixels() const {
    return {static_cast<std::uint32_t>(pixel_x0), static_cast<std::uint32_t>(pixel_y0),
            static_cast<std::uint32_t>(pixel_x1), static_cast<std::uint32_t>(pixel_y1)};
  }
};

}  // namespace candela::integrators
