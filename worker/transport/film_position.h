#pragma once

namespace candela::transport {

// A place on the film, in pixels; (0, 0) is the top left corner.
struct FilmPosition {
  float x = 0, y = 0;
};

}  // namespace candela::transport
