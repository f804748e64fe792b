// Distributions of microfacet normals: Beckmann and GGX (Trowbridge-Reitz), anisotropic, with Smith's masking
// function.
//
// D   density of normals per projected area [Walter et al. 2007]
// G1  Smith's masking; exact for both (Mitsuba approximates Beckmann's within 0.35 %)
// G   G1(wo) G1(wi), separable, as Mitsuba has it
// Sampling of visible normals is by inversion, exact: GGX by spherical caps [Dupuy and Benyoub 2023],
// Beckmann by the distribution of visible slopes [Heitz and d'Eon 2014] inverted numerically.
//
// All in the local frame, w.z > 0.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "worker/core/math.h"
#include "worker/core/vec.h"

namespace candela::scene {

// Slopes of the sampled visible facets of a Beckmann surface of unit roughness, seen from an angle of cosine
// cos_theta and sine sin_theta. microfacet.cpp.
double sample_beckmann_visible_slope(double cos_theta, double sin_theta, double u);
// Smith's masking of a Beckmann surface, a = cot(theta) / alpha.
float beckmann_masking(float a);

struct Microfacets {
  float alpha_u, alpha_v;
  bool ggx;

  float D(Vec3 h) const {
    if (h.z <= 0) return 0;
    const float x = h.x / alpha_u;
    const float y = h.y / alpha_v;
    const float slope2 = x * x + y * y;
    const float z2 = h.z * h.z;
    const float norm = math::kInvPi / (alpha_u * alpha_v);
    if (ggx) {
      const float q = slope2 + z2;
      return norm / (q * q);
    }
    const float t = slope2 / z2;
    if (!(t < 80)) return 0;  // below 1e-34 of the peak
    return norm * math::expf(-t) / (z2 * z2);
  }

  // G1(w) / w.z, finite at grazing angles.
  float masking_over_cosine(Vec3 w) const {
    const float x = alpha_u * w.x;
    const float y = alpha_v * w.y;
    const float s2 = x * x + y * y;
    if (ggx) return 2 / (w.z + std::sqrt(w.z * w.z + s2));
    if (s2 == 0) return 1 / w.z;
    const float s = std::sqrt(s2);
    const float a = w.z / s;
    // Towards grazing G1 = 2 sqrt(pi) a (1 + O(a)), so that G1 / w.z tends to 2 sqrt(pi) / s.
    if (a < 1e-6f) return 3.5449077f / s;
    return beckmann_masking(a) / w.z;
  }
  float G1(Vec3 w) const { return w.z * masking_over_cosine(w); }

  // A normal visible from w, with density D(h) G1(w) dot(w, h) / w.z.
  Vec3 sample_visible(Vec3 w, Vec2 u) const;

  // A normal with density D(h) h.z.
  Vec3 sample_all(Vec2 u) const {
    const float r2 = ggx ? u.y / (1 - u.y) : -math::logf(1 - u.y);
    const float r = std::sqrt(std::max(0.0f, r2));
    float s = 0;
    float c = 0;
    math::sincosf(2 * math::kPi * u.x, s, c);
    return normalize(Vec3{alpha_u * r * c, alpha_v * r * s, 1});
  }
};

// The normals visible from one direction. Most of the work of Beckmann's is an inversion that depends on u.x
// alone: a sum over many u.y computes it once.
class VisibleNormals {
 public:
  // The part that all u.y share. GGX: sine and cosine of the azimuth. Beckmann: the slope along the view, 0.
  using Share = std::array<float, 2>;

  VisibleNormals(const Microfacets& m, Vec3 w)
      : m_(m), v_(Vec3{m.alpha_u * w.x, m.alpha_v * w.y, w.z}), length2_(length_squared(v_)) {
    if (!meets()) return;
    v_ = v_ * (1 / std::sqrt(length2_));
    if (!m.ggx) sin_theta_ = std::sqrt(static_cast<double>(v_.x) * v_.x + static_cast<double>(v_.y) * v_.y);
  }

  Share share(float u_x) const {
    Share out{};
    if (!meets()) return out;
    if (m_.ggx)
      math::sincosf(2 * math::kPi * u_x, out[0], out[1]);
    else
      out[0] = static_cast<float>(sample_beckmann_visible_slope(v_.z, sin_theta_, u_x));
    return out;
  }

  Vec3 normal(const Share& share, float u_y) const {
    if (!meets()) return {0, 0, 1};
    Vec3 n;
    if (m_.ggx) {
      // h.z = (1 - u) (1 + v.z) without the cancellation of z + v.z.
      const float hz = (1 - u_y) * (1 + v_.z);
      const float z = hz - v_.z;
      const float r = std::sqrt(std::max(0.0f, (1 - z) * (1 + z)));
      n = {r * share[1] + v_.x, r * share[0] + v_.y, hz};
    } else {
      const float along = share[0];
      const float across = math::erfinvf(std::max(-1 + 0x1p-23f, 2 * u_y - 1));
      const float cos_phi = sin_theta_ > 0 ? static_cast<float>(v_.x / sin_theta_) : 1.0f;
      const float sin_phi = sin_theta_ > 0 ? static_cast<float>(v_.y / sin_theta_) : 0.0f;
      n = {-(cos_phi * along - sin_phi * across), -(sin_phi * along + cos_phi * across), 1};
    }
    const Vec3 h = {m_.alpha_u * n.x, m_.alpha_v * n.y, std::max(n.z, 0.0f)};
    const float h_len2 = length_squared(h);
    if (!(h_len2 > 1e-36f)) return {0, 0, 1};
    return h * (1 / std::sqrt(h_len2));
  }

 private:
  bool meets() const { return length2_ > 1e-36f; }

  const Microfacets& m_;
  Vec3 v_;  // the direction, seen by a surface of unit roughness
  float length2_;
  double sin_theta_ = 0;
};

inline Vec3 Microfacets::sample_visible(Vec3 w, Vec2 u) const {
  const VisibleNormals normals(*this, w);
  return normals.normal(normals.share(u.x), u.y);
}

}  // namespace candela::scene
