#include "common/stats/halves.h"

#include <algorithm>

namespace candela::stats {

Halves halves_of(const film::MergedFilm& film, const film::Development& development) {
  using Which = film::MergedFilm::Which;
  Halves halves;
  halves.width = film.layout().width;
  halves.height = film.layout().height;
  halves.n0 = static_cast<double>(film.merged(0).count());
  halves.n1 = static_cast<double>(film.merged(1).count());
  halves.chains = development.two_layers;
  halves.factor_variance = development.factor_variance;
  halves.row = [&film, &development, image = std::vector<double>()](std::uint32_t y, std::span<double> a,
                                                                    std::span<double> b,
                                                                    std::span<double> scaled) mutable {
    film::develop_image_row(film, development, y, Which::half0, a, scaled);
    film::develop_image_row(film, development, y, Which::half1, b, scaled);
    if (!(development.factor_variance > 0)) return;
    image.resize(a.size());
    film::develop_image_row(film, development, y, Which::both, image, scaled);
  };
  return halves;
}

HalfImages images_of(const Halves& halves) {
  HalfImages images{
      halves.width, halves.height, halves.n0, halves.n1, halves.chains, halves.factor_variance, {}, {}, {}};
  const std::size_t row_values = std::size_t{halves.width} * film::kChannels;
  std::vector<double> a(row_values), b(row_values), scaled(row_values);
  for (std::uint32_t y = 0; y < halves.height; ++y) {
    halves.row(y, a, b, scaled);
    for (std::size_t i = 0; i < row_values; ++i) {
      images.a.push_back(static_cast<float>(a[i]));
      images.b.push_back(static_cast<float>(b[i]));
      if (halves.factor_variance > 0) images.scaled.push_back(static_cast<float>(scaled[i]));
    }
  }
  return images;
}

Halves halves_of(const HalfImages& images) {
  Halves halves{images.width, images.height, images.n0, images.n1, images.chains, images.factor_variance, {}};
  halves.row = [&images](std::uint32_t y, std::span<double> a, std::span<double> b,
                         std::span<double> scaled) {
    const std::size_t first = y * a.size();
    for (std::size_t i = 0; i < a.size(); ++i) {
      a[i] = images.a[first + i];
      b[i] = images.b[first + i];
      if (!images.scaled.empty()) scaled[i] = images.scaled[first + i];
    }
  };
  return halves;
}

}  // namespace candela::stats
