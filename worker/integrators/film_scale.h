// The scale of a film, from a pilot's samples.
#pragma once

#include <cmath>
#include <span>

#include "common/film/unit_film.h"

namespace candela::integrators {

// The scale of a film from luminances of samples: by (mean of square roots)^2, of the mean's order, which no
// one bright path among them can set alone. If no sample met light, which may be rare: by the emitters
// themselves, with room below them.
inline int film_scale_log2(std::span<const float> luminances, float max_emitted_radiance) {
  double root_sum = 0;
  for (const float value : luminances) root_sum += std::sqrt(static_cast<double>(value));
  double typical = luminances.empty() ? 0 : root_sum / static_cast<double>(luminances.size());
  typical *= typical;
  if (!(typical > 0)) typical = static_cast<double>(max_emitted_radiance) * 0x1p-20;
  if (!(typical > 0)) typical = 1;
  return film::scale_log2_for(typical);
}

}  // namespace candela::integrators
