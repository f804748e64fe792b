#include "worker/mcmc/splat_list.h"

#include <algorithm>

namespace candela::mcmc {

std::optional<film::RejectCause> SplatList::fault() const {
  bool infinite = !std::isfinite(static_cast<float>(scalar_)), negative = false;
  for (const Splat& splat : splats_) {
    for (const float v : {splat.value.r, splat.value.g, splat.value.b}) {
      if (std::isnan(v)) return film::RejectCause::not_a_number;
      infinite = infinite || std::isinf(v);
      negative = negative || v < 0;
    }
  }
  if (infinite) return film::RejectCause::infinite;
  if (negative) return film::RejectCause::negative;
  return std::nullopt;
}

transport::FilmPosition SplatList::brightest() const {
  return std::max_element(
             splats_.begin(), splats_.end(),
             [](const Splat& a, const Splat& b) { return luminance(a.value) < luminance(b.value); })
      ->at;
}

void SplatList::sum_again() {
  scalar_ = 0;
  for (const Splat& splat : splats_) scalar_ += weighted(splat, splat.value);
}

}  // namespace candela::mcmc
