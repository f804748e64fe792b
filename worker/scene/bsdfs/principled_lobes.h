// Lobes that Disney's two materials share [Burley 2012] [Burley 2015].
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>

#include "worker/core/vec.h"
#include "worker/scene/textures/texture.h"

namespace candela::scene::principled {

inline constexpr float kMinGgxAlpha = 0.001f;  // Mitsuba's
inline constexpr float kMinRate = 0.01f;       // no lobe is left to chance alone

inline float unit(float v) {
  return std::clamp(v, 0.0f, 1.0f);
}

// Two roughnesses of the same product, their ratio up to 10 [Burley 2012, section 5.4].
inline std::pair<float, float> ggx_alphas(float roughness, float anisotropic) {
  const float alpha = roughness * roughness;
  const float aspect = std::sqrt(1 - 0.9f * anisotropic);
  return {std::max(kMinGgxAlpha, alpha / aspect), std::max(kMinGgxAlpha, alpha * aspect)};
}

inline float schlick_weight(float cosine) {
  const float m = std::clamp(1 - cosine, 0.0f, 1.0f);
  return m * m * m * m * m;
}

inline float sine2(Vec3 h, Vec3 w) {
  return std::min(1.0f, length_squared(cross(h, w)));
}

// Diffuse and retro-reflection, flattened, as a factor of the Lambertian value. Cosines over 0; cos_d: to the
// half vector.
inline float diffuse_factor(float cos_o, float cos_i, float cos_d, float roughness, float flatness) {
  const float f_i = schlick_weight(cos_i);
  const float f_o = schlick_weight(cos_o);
  const float retro90 = 2 * roughness * cos_d * cos_d;
  // [Burley 2015, section 5.1]
  const float diffuse = (1 - 0.5f * f_o) * (1 - 0.5f * f_i);
  const float retro = retro90 * (f_i + f_o + f_i * f_o * (retro90 - 1));
  float base = diffuse + retro;
  if (flatness > 0) {
    // After Hanrahan and Krueger [Burley 2012].
    const float ss90 = 0.5f * retro90;
    const float ss = (1 + (ss90 - 1) * f_i) * (1 + (ss90 - 1) * f_o);
    const float flat = 1.25f * (ss * (1 / (cos_o + cos_i) - 0.5f) + 0.5f);
    base += flatness * (flat - base);
  }
  return base;
}

}  // namespace candela::scene::principled
