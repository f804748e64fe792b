#include "worker/scene/bsdfs/two_colors.h"

namespace candela::scene {

Result<void> TwoColors::build(const description::Object& object, const BuildContext& context) {
  CANDELA_ASSIGN(diffuse, read_reflectance(object, context.textures, "diffuse_reflectance", 0.5f));
  CANDELA_ASSIGN(specular, read_reflectance(object, context.textures, "specular_reflectance", 0.2f));
  const float most = (diffuse.maximum() + specular.maximum()).max_component();
  if (most > 1) scale = 0.99f / most;
  return {};
}

float TwoColors::prepare(const SurfacePoint& at, Spectrum& diffuse_here, Spectrum& specular_here) const {
  diffuse_here = diffuse.eval(at) * scale;
  specular_here = specular.eval(at) * scale;
  const float d = luminance(diffuse_here);
  const float s = luminance(specular_here);
  return s > 0 ? s / (d + s) : 0.0f;
}

float TwoColors::max_albedo() const {
  return scale * (diffuse.maximum() + specular.maximum()).max_component();
}

}  // namespace candela::scene
