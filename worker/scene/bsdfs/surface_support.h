// What the surfaces' build() functions share.
#pragma once

#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/description/object.h"
#include "worker/scene/textures/texture.h"

namespace candela::scene {

// An error at the property or child `property` of `object`, or at the object where it has none.
Error located(std::string message, const description::Object& object, std::string_view property);
// A number for messages, without trailing zeros.
std::string shown(float v);
bool given(const description::Object& object, std::string_view property);

// A colour between 0 and 1: more would make light.
Result<ColorTexture> read_reflectance(const description::Object& object, TextureStore& textures,
                                      std::string_view name, float otherwise);
// int_ior / ext_ior, from 0.001 to 1000.
Result<float> read_relative_eta(const description::Object& object, double int_otherwise,
                                double ext_otherwise);

// alpha or alpha_u and alpha_v, distribution and sample_visible, as all rough bsdfs have them.
struct RoughnessParameters {
  FloatTexture alpha_u, alpha_v;
  bool ggx = false;
  bool sample_visible = true;
};
Result<RoughnessParameters> read_roughness(const description::Object& object, TextureStore& textures);
// Mitsuba's least roughness: below it the lobe is narrower than float directions resolve.
inline constexpr float kLeastAlpha = 1e-4f;

}  // namespace candela::scene
