#include "common/stats/halves.h"

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

}  // namespace candela::stats
