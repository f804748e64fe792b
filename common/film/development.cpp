#include "common/film/development.h"

#include <algorithm>

namespace candela::film {

namespace {

void add_corrections(const MergedFilm& film, const Development& development, std::uint32_t y,
                     MergedFilm::Which which, std::span<double> row) {
  double iterations = 0;
  for (std::uint32_t half = 0; half < 2; ++half)
    if (which == MergedFilm::Which::both || (which == MergedFilm::Which::half0) == (half == 0))
      iterations += static_cast<double>(film.merged(half).count());
  if (!(iterations > 0)) return;
  for (std::uint32_t half = 0; half < 2; ++half) {
    if (which != MergedFilm::Which::both && (which == MergedFilm::Which::half0) != (half == 0)) continue;
    if (!development.corrections[half]) continue;
    const float* from = development.corrections[half]->data() + y * row.size();
    for (std::size_t i = 0; i < row.size(); ++i) row[i] += static_cast<double>(from[i]) / iterations;
  }
}

}  // namespace

void develop_image_row(const MergedFilm& film, const Development& development, std::uint32_t y,
                       MergedFilm::Which which, std::span<double> out, std::span<double> scaled) {
  film.develop_row(0, y, which, scaled);
  add_corrections(film, development, y, which, scaled);
  if (development.factor != 1)
    for (double& value : scaled) value *= development.factor;
  if (!development.two_layers) {
    std::copy(scaled.begin(), scaled.end(), out.begin());
    return;
  }
  film.develop_row(1, y, which, out);
  for (std::size_t i = 0; i < out.size(); ++i) out[i] += scaled[i];
}

std::vector<float> develop_image(const MergedFilm& film, const Development& development,
                                 MergedFilm::Which which) {
  const std::size_t row_values = std::size_t{film.layout().width} * kChannels;
  std::vector<float> image(row_values * film.layout().height);
  std::vector<double> row(row_values), scaled(row_values);
  for (std::uint32_t y = 0; y < film.layout().height; ++y) {
    develop_image_row(film, development, y, which, row, scaled);
    float* to = image.data() + y * row_values;
    for (std::size_t i = 0; i < row_values; ++i) to[i] = static_cast<float>(row[i]);
  }
  return image;
}

}  // namespace candela::film
