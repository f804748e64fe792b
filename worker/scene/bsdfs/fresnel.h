// Fresnel's equations for unpolarised light, as fractions of power.
#pragma once

#include <algorithm>
#include <cmath>

#include "worker/core/vec.h"

namespace candela::scene {

// From both cosines, of incidence and refraction, in [0, 1]; eta: index on the far side over the near side.
template <class T>
inline T fresnel_of_cosines(T cos_i, T cos_t, T eta) {
  if (eta == 1) return 0;  // index-matched: no boundary, at grazing angles too
  const T s = cos_i - eta * cos_t;
  const T p = eta * cos_i - cos_t;
  const T s_sum = cos_i + eta * cos_t;
  const T p_sum = eta * cos_i + cos_t;
  if (s_sum <= 0 || p_sum <= 0) return 1;
  const T r_s = s / s_sum;
  const T r_p = p / p_sum;
  return std::min(T(1), T(0.5) * (r_s * r_s + r_p * r_p));
}

// cos_t gets the cosine of refraction (0 at total internal reflection). sin2_i = 1 - cos_i^2, passed because
// the caller knows it without cancellation.
template <class T>
inline T fresnel_dielectric(T cos_i, T sin2_i, T eta, T& cos_t) {
  const T sin2_t = sin2_i / (eta * eta);
  if (sin2_t >= 1) {
    cos_t = 0;
    return 1;
  }
  cos_t = std::sqrt(1 - sin2_t);
  return fresnel_of_cosines(cos_i, cos_t, eta);
}

// eta + i k relative to the outside; cos_i in [0, 1].
inline float fresnel_conductor(float cos_i, float eta, float k) {
  const float c2 = cos_i * cos_i;
  const float s2 = std::max(0.0f, 1 - c2);
  const float eta2 = eta * eta;
  const float k2 = k * k;
  const float t0 = eta2 - k2 - s2;
  const float a2b2 = std::sqrt(t0 * t0 + 4 * eta2 * k2);
  // sqrt((a2b2 + t0) / 2); where t0 is negative the sum cancels, its product form does not.
  const float a2 = t0 >= 0 ? 0.5f * (a2b2 + t0) : (a2b2 - t0 > 0 ? 2 * eta2 * k2 / (a2b2 - t0) : 0.0f);
  const float cross = 2 * cos_i * std::sqrt(std::max(0.0f, a2));
  const float s_num = a2b2 + c2;
  if (!(s_num + cross > 0)) return 1;
  const float r_s = (s_num - cross) / (s_num + cross);
  const float p_num = c2 * a2b2 + s2 * s2;
  const float p_cross = cross * s2;
  const float r_p = p_num + p_cross > 0 ? r_s * (p_num - p_cross) / (p_num + p_cross) : r_s;
  return std::min(1.0f, std::max(0.0f, 0.5f * (r_s + r_p)));
}
inline Spectrum fresnel_conductor(float cos_i, Spectrum eta, Spectrum k) {
  return {fresnel_conductor(cos_i, eta.r, k.r), fresnel_conductor(cos_i, eta.g, k.g),
          fresnel_conductor(cos_i, eta.b, k.b)};
}

}  // namespace candela::scene
