// The coats of plastics as a whole: tabulated transmittance and mean reflectances.
#include <gtest/gtest.h>

#include <cmath>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/fresnel.h"
#include "worker/scene/bsdfs/kinds.h"
#include "worker/scene/bsdfs/rough_transmittance.h"

namespace candela::scene {
namespace {

// The reflectance of a rough boundary by another way than the tables': all normals are sampled, not the
// visible ones, on a fine grid.
double reflectance(bool ggx, float alpha, float eta, double mu, int steps) {
  Closure c;
  c.set(RoughDielectricClosure{Spectrum(1), Spectrum(0), eta, alpha, alpha, ggx, false});
  const Vec3 wo{static_cast<float>(std::sqrt(1 - mu * mu)), 0, static_cast<float>(mu)};
  double sum = 0;
  for (int i = 0; i < steps; ++i) {
    for (int j = 0; j < steps; ++j) {
      BsdfSample s;
      const Vec2 u{(static_cast<float>(i) + 0.5f) / static_cast<float>(steps),
                   (static_cast<float>(j) + 0.5f) / static_cast<float>(steps)};
      if (c.sample(wo, 0, u, TransportMode::radiance, s)) sum += static_cast<double>(s.weight.g);
    }
  }
  return sum / (steps * steps);
}

// Claim: the table is one minus the reflectance of the same boundary as roughdielectric, from outside, and
// its mean that from inside.
TEST(RoughTransmittance, IsWhatTheCoatDoesNotReflect) {
  for (const bool ggx : {false, true}) {
    for (const float alpha : {0.02f, 0.2f, 0.7f}) {
      // Total reflection from outside makes both quadratures coarser.
      for (const float eta : {1.49f, 1 / 1.5f, 4.0f}) {
        const RoughTransmittance table(ggx, alpha, eta);
        for (const double mu : {0.03, 0.1, 0.3, 0.55, 0.77, 0.96}) {
          EXPECT_NEAR(static_cast<double>(table.transmittance(static_cast<float>(mu))),
                      1 - reflectance(ggx, alpha, eta, mu, 250), eta < 1 ? 8e-3 : 3e-3)
              << ggx << " " << alpha << " " << eta << " " << mu;
        }
        double inside = 0;
        constexpr int kSteps = 64;
        for (int i = 0; i < kSteps; ++i) {
          const double mu = std::sqrt((i + 0.5) / kSteps);
          inside += reflectance(ggx, alpha, 1 / eta, mu, 64) / kSteps;
        }
        if (eta > 1) {
          EXPECT_NEAR(table.internal_reflectance(), inside, 2e-3) << ggx << " " << alpha << " " << eta;
        } else {
          EXPECT_LE(table.internal_reflectance(), inside + 2e-3) << ggx << " " << alpha << " " << eta;
        }
      }
    }
  }
}

// Claim: the mean reflectance of a smooth boundary is Fresnel's integral, from both sides; 0.0918 and 0.5963
// for an index of 1.5.
TEST(FresnelDiffuseReflectance, IsTheIntegral) {
  EXPECT_NEAR(fresnel_diffuse_reflectance(1.5), 0.0918, 1e-4);
  EXPECT_NEAR(fresnel_diffuse_reflectance(1 / 1.5), 0.5963, 1e-4);
  EXPECT_EQ(fresnel_diffuse_reflectance(1), 0);
  for (const double eta : {1.001, 1.3, 4.0, 900.0, 1 / 1.3, 0.1}) {
    double sum = 0;
    constexpr int kSteps = 300000;
    for (int i = 0; i < kSteps; ++i) {
      const double mu2 = (i + 0.5) / kSteps;
      double cos_t = 0;
      sum += fresnel_dielectric(std::sqrt(mu2), 1 - mu2, eta, cos_t);
    }
    EXPECT_NEAR(fresnel_diffuse_reflectance(eta), sum / kSteps, 1e-6) << eta;
  }
}

}  // namespace
}  // namespace candela::scene
