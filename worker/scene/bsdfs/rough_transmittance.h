// Total transmittance of a rough dielectric boundary: the light that gets through to a diffuse
// base beneath it. As in Mitsuba, what Smith's masking loses outside counts as passing.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <tuple>

namespace candela::scene {

// 2 int_0^1 F(mu) mu dmu of a smooth boundary: the mean reflectance for diffuse light that meets it. eta: the
// far side's index over the near side's. By quadrature in double; error below 1e-7.
double fresnel_diffuse_reflectance(double eta);

class RoughTransmittance {
 public:
  // eta: index inside over outside; alpha as microfacet.h has it. Takes some 10 ms; the same on every
  // machine.
  RoughTransmittance(bool ggx, float alpha, float eta);

  // 1 - the reflectance for light from outside at cosine mu in [0, 1]; linear in sqrt(mu) between the nodes,
  // error below 2e-3 but next to the critical angle.
  float transmittance(float mu) const {
    const float x = std::sqrt(std::clamp(mu, 0.0f, 1.0f)) * (kNodes - 1);
    const int i = std::min(static_cast<int>(x), kNodes - 2);
    const auto n = static_cast<std::size_t>(i);
    const float t = x - static_cast<float>(i);
    return nodes_[n] + t * (nodes_[n + 1] - nodes_[n]);
  }
  // The mean reflectance for diffuse light from inside; at most internal_return(), for else more light would
  // come out than went in. That bound counts where the inside is the thinner medium, and where nearly all is
  // reflected inside. What masking loses inside is lost: Mitsuba 2 and 3.
  double internal_reflectance() const { return internal_reflectance_; }
  // 1 - (mean transmittance) / eta^2: what does not come out stays inside, so that no light is lost.
  // Mitsuba 0.6.
  double internal_return() const { return internal_return_; }

 private:
  static constexpr int kNodes = 256;
  std::array<float, kNodes> nodes_;
  double internal_reflectance_, internal_return_;
};

// One table for each distribution, roughness and index.
class RoughTransmittances {
 public:
  std::shared_ptr<const RoughTransmittance> get(bool ggx, float alpha, float eta);

 private:
  std::map<std::tuple<bool, float, float>, std::shared_ptr<const RoughTransmittance>> tables_;
};

}  // namespace candela::scene
