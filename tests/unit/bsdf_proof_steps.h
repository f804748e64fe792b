// Small steps of the proofs of bsdfs: directions, draws, and how far rounding moves a value.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "common/rng/stream.h"
#include "scene_fixture.h"
#include "worker/scene/bsdf.h"

namespace candela::test {

inline bool long_form() {
  const char* text = std::getenv("CANDELA_LONG");
  return text != nullptr && std::string(text) == "1";
}

inline std::uint64_t seed_of(const std::string& name) {
  std::uint64_t key = 0;
  for (const char c : name) key = rng::combine(key, static_cast<unsigned char>(c));
  return key;
}

inline Vec3 direction(double cos_theta, double phi) {
  const double s = std::sqrt(std::max(0.0, (1 - cos_theta) * (1 + cos_theta)));
  return {static_cast<float>(s * std::cos(phi)), static_cast<float>(s * std::sin(phi)),
          static_cast<float>(cos_theta)};
}

inline scene::TransportMode other(scene::TransportMode mode) {
  return mode == scene::TransportMode::radiance ? scene::TransportMode::importance
                                                : scene::TransportMode::radiance;
}

inline double largest(Spectrum s) {
  return static_cast<double>(s.max_component());
}
inline std::array<double, 3> channels(Spectrum s) {
  return {static_cast<double>(s.r), static_cast<double>(s.g), static_cast<double>(s.b)};
}
inline bool sound(Spectrum s) {
  return std::isfinite(s.r) && std::isfinite(s.g) && std::isfinite(s.b) && s.r >= 0 && s.g >= 0 && s.b >= 0;
}

inline std::string shown(Vec3 w) {
  return fmt::format("({} {} {})", w.x, w.y, w.z);
}

inline bool draw(const scene::Closure& closure, Vec3 wo, rng::Stream& stream, scene::TransportMode mode,
                 scene::BsdfSample& out) {
  const float u_lobe = stream.next_float();
  const float ux = stream.next_float();
  const float uy = stream.next_float();
  return closure.sample(wo, u_lobe, {ux, uy}, mode, out);
}

// Directions are known to a rounding error; a density is known to what that makes of it.
inline constexpr float kRounding = 2e-7f;
template <class Function>
double relative_spread(Vec3 wo, Vec3 wi, std::uint64_t key, const Function& f) {
  rng::Stream stream(key);
  const double here = f(wo, wi);
  double most = 0;
  for (int i = 0; i < 4; ++i) {
    const Vec3 o = normalize(wo + uniform_direction(stream) * kRounding);
    const Vec3 in = normalize(wi + uniform_direction(stream) * kRounding);
    most = std::max(most, std::abs(f(o, in) - here));
  }
  return here > 0 ? most / here : 1e9;
}

struct DeltaLobe {
  scene::BsdfSample sample;
  int count = 0;
};

}  // namespace candela::test
