#include "worker/scene/bsdfs/rough_transmittance.h"

#include "worker/scene/bsdfs/fresnel.h"
#include "worker/scene/bsdfs/microfacet.h"

namespace candela::scene {
namespace {

// Gauss and Legendre's 5 points on [0, 1], used panel by panel.
constexpr std::array<double, 5> kPoints = {0.046910077030668, 0.2307653449471585, 0.5, 0.7692346550528415,
                                           0.953089922969332};
constexpr std::array<double, 5> kWeights = {0.1184634425280945, 0.239314335249683, 0.2844444444444444,
                                            0.239314335249683, 0.1184634425280945};

template <class Function>
double integrate(int panels, const Function& f) {
  double sum = 0;
  for (int i = 0; i < panels; ++i) {
    for (std::size_t k = 0; k < kPoints.size(); ++k) sum += kWeights[k] * f((i + kPoints[k]) / panels);
  }
  return sum / panels;
}

// The part of the light from a cosine mu that a rough boundary reflects: the mean over its visible normals
// of F G1.
double reflectance(const Microfacets& m, double mu, float eta, int panels) {
  const Vec3 wo{static_cast<float>(std::sqrt((1 - mu) * (1 + mu))), 0, static_cast<float>(mu)};
  const VisibleNormals normals(m, wo);
  return integrate(panels, [&](double u) {
    const VisibleNormals::Share share = normals.share(static_cast<float>(u));
    return integrate(panels, [&](double v) {
      const Vec3 h = normals.normal(share, static_cast<float>(v));
      const float cos_d = std::min(1.0f, dot(wo, h));
      if (!(cos_d > 0)) return 0.0;
      const Vec3 wi = h * (2 * cos_d) - wo;
      if (!(wi.z > 0)) return 0.0;
      float cos_t = 0;
      const float f = fresnel_dielectric(cos_d, (1 - cos_d) * (1 + cos_d), eta, cos_t);
      return static_cast<double>(f * m.G1(normalize(wi)));
    });
  });
}

}  // namespace

double fresnel_diffuse_reflectance(double eta) {
  if (eta < 1) {
    // Light that leaves is light that could have entered: (1 - F) of both sides by Helmholtz, without the
    // kink of total reflection.
    return 1 - (1 - fresnel_diffuse_reflectance(1 / eta)) * eta * eta;
  }
  return integrate(64, [&](double s) {
    const double mu = s * s;  // fine towards grazing angles
    double cos_t = 0;
    return 4 * s * mu * fresnel_dielectric(mu, (1 - mu) * (1 + mu), eta, cos_t);
  });
}

RoughTransmittance::RoughTransmittance(bool ggx, float alpha, float eta) {
  const Microfacets m{alpha, alpha, ggx};
  for (int i = 0; i < kNodes; ++i) {
    const double s = static_cast<double>(i) / (kNodes - 1);
    nodes_[static_cast<std::size_t>(i)] =
        static_cast<float>(1 - reflectance(m, s * s, eta, eta < 1 ? 10 : 5));
  }
  const double inside = integrate(12, [&](double mu) { return 2 * mu * reflectance(m, mu, 1 / eta, 8); });
  const double entering =
      integrate(32, [&](double mu) { return 2 * mu * transmittance(static_cast<float>(mu)); });
  internal_return_ = 1 - entering / (static_cast<double>(eta) * eta);
  internal_reflectance_ = std::min(inside, internal_return_);
}

std::shared_ptr<const RoughTransmittance> RoughTransmittances::get(bool ggx, float alpha, float eta) {
  auto& table = tables_[{ggx, alpha, eta}];
  if (table == nullptr) table = std::make_shared<const RoughTransmittance>(ggx, alpha, eta);
  return table;
}

}  // namespace candela::scene
