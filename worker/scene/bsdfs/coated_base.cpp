#include "worker/scene/bsdfs/coated_base.h"

#include <algorithm>

namespace candela::scene {

Result<void> CoatedBase::build(const description::Object& object, const BuildContext& context) {
  CANDELA_ASSIGN(diffuse, read_reflectance(object, context.textures, "diffuse_reflectance", 0.5f));
  CANDELA_ASSIGN(specular, read_reflectance(object, context.textures, "specular_reflectance", 1));
  CANDELA_ASSIGN(eta, read_relative_eta(object, 1.49, 1.000277));  // polypropylene in air
  nonlinear = object.get_bool("nonlinear", false);
  return {};
}

bool CoatedBase::prepare(const SurfacePoint& at, double internal_reflectance_here, Spectrum& base,
                         Spectrum& coat, float& specular_share) const {
  const Spectrum d = diffuse.eval(at);
  coat = specular.eval(at);
  const float d_sum = d.r + d.g + d.b;
  const float s_sum = coat.r + coat.g + coat.b;
  if (!(d_sum + s_sum > 0)) return false;
  specular_share = s_sum / (d_sum + s_sum);
  // In double: with a high index nearly all is reflected inside, and eta^2 makes up for it.
  const auto left = [&](float rho) {
    const double lost = 1 - (nonlinear ? static_cast<double>(rho) : 1.0) * internal_reflectance_here;
    return static_cast<float>(static_cast<double>(rho) / (lost * static_cast<double>(eta) * eta));
  };
  base = {left(d.r), left(d.g), left(d.b)};
  return true;
}

float CoatedBase::max_albedo() const {
  return std::max(diffuse.maximum().max_component(), specular.maximum().max_component());
}

}  // namespace candela::scene
