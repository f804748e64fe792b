#include "worker/scene/bsdfs/surface.h"

#include <algorithm>

namespace candela::scene {

void BsdfFacts::forget_lobes() {
  delta = smooth = transmissive = passthrough = false;
  max_albedo = 0;
  min_roughness = 1;
}

void BsdfFacts::join(const BsdfFacts& other) {
  delta |= other.delta;
  smooth |= other.smooth;
  transmissive |= other.transmissive;
  passthrough |= other.passthrough;
  two_sided |= other.two_sided;
  perturbs |= other.perturbs;
  reads_partials |= other.reads_partials;
  max_albedo = std::max(max_albedo, other.max_albedo);
  min_roughness = std::min(min_roughness, other.min_roughness);
}

Error located(std::string message, const description::Object& object, std::string_view property) {
  description::Location where = object.where;
  if (const description::Property* p = object.find(property)) where = p->where;
  if (const description::Child* c = object.find_child(property)) where = c->object->where;
  return input_error(std::move(message)).at(where.file, where.line).with_field(std::string(property));
}

std::string shown(float v) {
  std::string text = std::to_string(v);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

bool given(const description::Object& object, std::string_view property) {
  return object.find(property) != nullptr || object.find_child(property) != nullptr;
}

Result<ColorTexture> read_reflectance(const description::Object& object, TextureStore& textures,
                                      std::string_view name, float otherwise) {
  CANDELA_ASSIGN(ColorTexture color, textures.color(object, name, Spectrum(otherwise)));
  const float most = color.maximum().max_component();
  if (most > 1) {
    return located("the largest value is " + shown(most) +
                       "; a surface cannot reflect or pass more than 1 of the light",
                   object, name)
        .with_mend("scale it into [0, 1]");
  }
  return color;
}

Result<FloatTexture> read_fraction(const description::Object& object, TextureStore& textures,
                                   std::string_view name, float otherwise) {
  CANDELA_ASSIGN(FloatTexture value, textures.number(object, name, otherwise));
  if (value.is_constant() && !(value.constant >= 0 && value.constant <= 1)) {
    return located(std::string(name) + " lies between 0 and 1, not at " + shown(value.constant), object,
                   name);
  }
  return value;
}

Result<float> read_relative_eta(const description::Object& object, double int_otherwise,
                                double ext_otherwise) {
  const double inside = object.get_number("int_ior", int_otherwise);
  const double outside = object.get_number("ext_ior", ext_otherwise);
  if (!(inside > 0)) return located("an index of refraction is above 0", object, "int_ior");
  if (!(outside > 0)) return located("an index of refraction is above 0", object, "ext_ior");
  const auto eta = static_cast<float>(inside / outside);
  if (!(eta >= 1e-3f && eta <= 1e3f)) {
    return located("int_ior over ext_ior is " + shown(eta) + "; from 0.001 to 1000 is supported", object,
                   "int_ior");
  }
  return eta;
}

namespace {

Result<FloatTexture> read_alpha(const description::Object& object, TextureStore& textures,
                                std::string_view name) {
  CANDELA_ASSIGN(FloatTexture alpha, textures.number(object, name, 0.1f));
  if (alpha.minimum() < 0) return located("roughness is not negative", object, name);
  return alpha;
}

}  // namespace

Result<RoughnessParameters> read_roughness(const description::Object& object, TextureStore& textures) {
  RoughnessParameters result;
  const std::string distribution = object.get_string("distribution", "beckmann");
  if (distribution != "beckmann" && distribution != "ggx") {
    return located("unknown distribution '" + distribution + "'; known: beckmann, ggx", object,
                   "distribution");
  }
  result.ggx = distribution == "ggx";
  result.sample_visible = object.get_bool("sample_visible", true);
  if (given(object, "alpha_u") != given(object, "alpha_v")) {
    return located("alpha_u and alpha_v go together", object,
                   given(object, "alpha_u") ? "alpha_u" : "alpha_v")
        .with_mend("give both, or alpha alone");
  }
  if (given(object, "alpha_u") && given(object, "alpha")) {
    return located("alpha excludes alpha_u and alpha_v", object, "alpha").with_mend("give either");
  }
  const bool anisotropic = given(object, "alpha_u");
  CANDELA_ASSIGN(result.alpha_u, read_alpha(object, textures, anisotropic ? "alpha_u" : "alpha"));
  CANDELA_ASSIGN(result.alpha_v, read_alpha(object, textures, anisotropic ? "alpha_v" : "alpha"));
  return result;
}

Result<std::vector<description::ObjectPtr>> nested_bsdfs(const description::Object& object, std::size_t min,
                                                         std::size_t max) {
  auto children = object.children_of("bsdf");
  if (children.size() < min || children.size() > max) {
    const std::string wanted =
        min == max ? std::to_string(min) : std::to_string(min) + " or " + std::to_string(max);
    return located(object.plugin + " holds " + wanted + " bsdfs; here are " + std::to_string(children.size()),
                   object, "");
  }
  return children;
}

}  // namespace candela::scene
