// The part of a film that is rendered: the image. A film without crop parameters is rendered whole.
#pragma once

#include <cstdint>

#include "common/description/object.h"

namespace candela::description {

struct FilmWindow {
  std::int64_t film_width = 768, film_height = 576;  // pixels, as all of these
  std::int64_t x = 0, y = 0;                         // the window's upper left corner
  std::int64_t width = 768, height = 576;
  // True if the window has pixels, and all of them are the film's.
  bool fits() const;
};

// Precondition: the film's sizes and crop parameters are integers.
FilmWindow film_window(const Object& film);

}  // namespace candela::description
