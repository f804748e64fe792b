#include "common/description/film_window.h"

namespace candela::description {

bool FilmWindow::fits() const {
  // Compared so that no sum overflows.
  return x >= 0 && y >= 0 && width >= 1 && height >= 1 && width <= film_width && height <= film_height &&
         x <= film_width - width && y <= film_height - height;
}

FilmWindow film_window(const Object& film) {
  FilmWindow window;
  window.film_width = film.get_integer("width", window.film_width);
  window.film_height = film.get_integer("height", window.film_height);
  window.x = film.get_integer("crop_offset_x", 0);
  window.y = film.get_integer("crop_offset_y", 0);
  window.width = film.get_integer("crop_width", window.film_width);
  window.height = film.get_integer("crop_height", window.film_height);
  return window;
}

}  // namespace candela::description
