// Phase functions: how a medium spreads what it scatters. A closed set by kind.
//
// Directions are unit, in the world, and point away from the scattering point as a bsdf's do: wo towards
// where the walk came from, wi where it goes on. Forward scattering is wi = -wo; g > 0 prefers it, as Mitsuba
// means it. Values integrate to one over the sphere and are reciprocal. Sampling is exact: the density of a
// direction is its value, and the weight of a sample is 1.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "worker/core/math.h"
#include "worker/core/vec.h"
#include "worker/core/warp.h"

namespace candela::scene {

enum class PhaseKind : std::uint8_t { isotropic, hg, rayleigh, blend };

class Phase {
 public:
  Phase() = default;  // isotropic
  // Mean cosine g of the deflection, in (-1, 1).
  static Phase henyey_greenstein(float g) {
    Phase phase;
    phase.kind_ = PhaseKind::hg;
    phase.g_ = g;
    return phase;
  }

  // Particles much smaller than the wavelength.
  static Phase rayleigh() {
    Phase phase;
    phase.kind_ = PhaseKind::rayleigh;
    return phase;
  }

  // `share` of the second, in [0, 1], and the rest of the first. False: they are made of more than kMaxParts
  // together.
  static constexpr std::size_t kMaxParts = 4;
  static bool blend(const Phase& first, const Phase& second, float share, Phase& out) {
    out = {};
    out.kind_ = PhaseKind::blend;
    return out.add(first, 1 - share) && out.add(second, share);
  }

  PhaseKind kind() const { return kind_; }
  float mean_cosine() const { return g_; }

  // Per steradian.
  float eval(Vec3 wo, Vec3 wi) const {
    if (kind_ != PhaseKind::blend) [[likely]]
      return value_of(kind_, g_, wo, wi);
    float sum = 0;
    for (std::size_t i = 0; i < part_count_; ++i)
      sum += parts_[i].weight * value_of(parts_[i].kind, parts_[i].g, wo, wi);
    return sum;
  }
  float pdf_solid_angle(Vec3 wo, Vec3 wi) const { return eval(wo, wi); }

  // Returns the density of wi.
  float sample(Vec3 wo, Vec2 u, Vec3& wi) const {
    const double w = 2 * static_cast<double>(u.x) - 1;
    double cosine = 0;
    switch (kind_) {
      case PhaseKind::blend: {
        std::size_t i = 0;
        double x = static_cast<double>(u.x);
        for (; i + 1 < part_count_ && x >= static_cast<double>(parts_[i].weight); ++i)
          x -= static_cast<double>(parts_[i].weight);
        x /= static_cast<double>(parts_[i].weight);
        part(i).sample(wo, {static_cast<float>(std::clamp(x, 0.0, 1.0 - 0x1p-24)), u.y}, wi);
        return eval(wo, wi);
      }
      case PhaseKind::isotropic:
        wi = warp::uniform_sphere(u);
        return warp::kPdfUniformSphereSolidAngle;
      case PhaseKind::rayleigh: {
        // cos^3 + 3 cos = 4 w by Cardano.
        const double a = math::pow(2 * w + std::sqrt(4 * w * w + 1), 1.0 / 3);
        cosine = a - 1 / a;
        break;
      }
      case PhaseKind::hg: {
        // The inverse of the cumulative distribution in the cosine [Henyey and Greenstein 1941], with its
        // division by g carried out, so that g may be zero.
        const double g = static_cast<double>(g_), d = 1 + g * w;
        cosine = (w + 0.5 * g * (w * w + 3) + g * g * w + 0.5 * g * g * g * (w * w - 1)) / (d * d);
        break;
      }
    }
    const double c = std::clamp(cosine, -1.0, 1.0);
    const auto sine = static_cast<float>(std::sqrt((1 - c) * (1 + c)));
    float sin_phi = 0, cos_phi = 0;
    math::sincosf(2 * math::kPi * u.y, sin_phi, cos_phi);
    wi = make_frame(-wo).to_world({sine * cos_phi, sine * sin_phi, static_cast<float>(c)});
    wi = wi * (1 / length(wi));
    if (kind_ == PhaseKind::rayleigh) return rayleigh_value(c);
    return static_cast<float>(hg_value(g_, g_ >= 0 ? 1 - c : 1 + c));
  }

 private:
  static float rayleigh_value(double cosine) {
    return static_cast<float>(0.75 * static_cast<double>(warp::kPdfUniformSphereSolidAngle) *
                              (1 + cosine * cosine));
  }
  // versed: 1 - cos of the deflection, or 1 + cos where g is negative. The denominator 1 + g^2 - 2 g cos is
  // (1 - |g|)^2 + 2 |g| versed, a sum that does not cancel.
  static double hg_value(float mean_cosine, double versed) {
    const double g = std::abs(static_cast<double>(mean_cosine));
    const double d = (1 - g) * (1 - g) + 2 * g * versed;
    return static_cast<double>(warp::kPdfUniformSphereSolidAngle) * (1 - g) * (1 + g) / (d * std::sqrt(d));
  }

  // The value of a single phase function, per steradian. Precondition: the kind is not blend.
  static float value_of(PhaseKind kind, float g, Vec3 wo, Vec3 wi) {
    switch (kind) {
      case PhaseKind::rayleigh:
        return rayleigh_value(static_cast<double>(dot(wo, wi)));
      case PhaseKind::hg: {
        // |wi -+ (-wo)|^2 is 2 (1 -+ cos) without its cancellation.
        const Vec3 s = g >= 0 ? wi + wo : wi - wo;
        return static_cast<float>(hg_value(g, 0.5 * static_cast<double>(length_squared(s))));
      }
      case PhaseKind::isotropic:
      case PhaseKind::blend:
        break;
    }
    return warp::kPdfUniformSphereSolidAngle;
  }

  struct Part {
    PhaseKind kind = PhaseKind::isotropic;
    float g = 0;
    float weight = 0;
  };
  Phase part(std::size_t i) const {
    Phase phase;
    phase.kind_ = parts_[i].kind;
    phase.g_ = parts_[i].g;
    return phase;
  }
  bool add(const Phase& phase, float weight) {
    if (phase.kind_ == PhaseKind::blend) {
      bool all = true;
      for (std::size_t i = 0; i < phase.part_count_; ++i)
        all = all && add(phase.part(i), weight * phase.parts_[i].weight);
      return all;
    }
    if (!(weight > 0)) return true;
    if (part_count_ == kMaxParts) return false;
    parts_[part_count_++] = {phase.kind_, phase.g_, weight};
    g_ += weight * phase.g_;
    return true;
  }

  PhaseKind kind_ = PhaseKind::isotropic;
  std::uint8_t part_count_ = 0;
  float g_ = 0;  // of a blend: the mean cosine
  std::array<Part, kMaxParts> parts_{};
};

}  // namespace candela::scene
