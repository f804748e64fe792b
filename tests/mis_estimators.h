// Corrections (common/mis/estimators.h) from all sums together, as the publications write them.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "common/mis/estimators.h"

namespace candela::mis {

inline Color crossfit(const Allocation& allocation, const Sums& half0, const Sums& half1, int scale_log2) {
  std::array<Color, 2> parts = crossfit_halves(allocation, half0, half1, scale_log2);
  for (std::size_t k = 0; k < kColors; ++k) parts[0][k] += parts[1][k];
  return parts[0];
}

inline Color direct(const Allocation& allocation, std::span<const Sums> parts, int scale_log2) {
  Sums all;
  for (const Sums& part : parts) all.add(part);
  return direct_halves(allocation, all, Sums(), scale_log2)[0];
}

inline Color progressive(const Allocation& allocation, std::span<const Sums> epochs, int scale_log2) {
  Color out{};
  Sums before;
  for (const Sums& epoch : epochs) {
    const Color part = correction(allocation, epoch, ridge_slopes(allocation, before, scale_log2));
    for (std::size_t k = 0; k < kColors; ++k) out[k] += part[k];
    before.add(epoch);
  }
  return out;
}

}  // namespace candela::mis
