// From description objects to Bsdfs, and from Bsdfs at a hit to Closures.
#include "worker/scene/bsdfs/bsdf_build.h"

#include <algorithm>
#include <cmath>

namespace candela::scene {
namespace {

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

// A colour between 0 and 1: more would make light.
Result<ColorTexture> reflectance(const description::Object& object, TextureStore& textures,
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

Result<FloatTexture> roughness(const description::Object& object, TextureStore& textures,
                               std::string_view name) {
  CANDELA_ASSIGN(FloatTexture alpha, textures.number(object, name, 0.1f));
  if (alpha.minimum() < 0) return located("roughness is not negative", object, name);
  return alpha;
}

}  // namespace

bool Bsdf::Side::black() const {
  const bool none = reflectance.maximum().is_black();
  return kind == BsdfKind::dielectric ? none && transmittance.maximum().is_black() : none;
}

Result<Bsdf::Side> Bsdf::build_side(const description::Object& object, TextureStore& textures) {
  Side side;
  const std::string& plugin = object.plugin;
  if (plugin == "diffuse") {
    side.kind = BsdfKind::diffuse;
    CANDELA_ASSIGN(side.reflectance, reflectance(object, textures, "reflectance", 0.5f));
    return side;
  }
  if (plugin == "dielectric") {
    side.kind = BsdfKind::dielectric;
    CANDELA_ASSIGN(side.reflectance, reflectance(object, textures, "specular_reflectance", 1));
    CANDELA_ASSIGN(side.transmittance, reflectance(object, textures, "specular_transmittance", 1));
    const double inside = object.get_number("int_ior", 1.5046);     // bk7
    const double outside = object.get_number("ext_ior", 1.000277);  // air
    if (!(inside > 0)) return located("an index of refraction is above 0", object, "int_ior");
    if (!(outside > 0)) return located("an index of refraction is above 0", object, "ext_ior");
    side.relative_eta = static_cast<float>(inside / outside);
    if (!(side.relative_eta >= 1e-3f && side.relative_eta <= 1e3f)) {
      return located(
          "int_ior over ext_ior is " + shown(side.relative_eta) + "; from 0.001 to 1000 is supported", object,
          "int_ior");
    }
    return side;
  }
  if (plugin == "conductor" || plugin == "roughconductor") {
    side.kind = plugin == "conductor" ? BsdfKind::conductor : BsdfKind::roughconductor;
    CANDELA_ASSIGN(side.reflectance, reflectance(object, textures, "specular_reflectance", 1));
    const std::string material = object.get_string("material", "none");
    if (material != "none") {
      return located("the named material '" + material + "' is not supported", object, "material")
          .with_mend("give eta and k as rgb");
    }
    // Without eta and k: a mirror that reflects all.
    CANDELA_ASSIGN(side.eta, textures.color(object, "eta", Spectrum(0)));
    CANDELA_ASSIGN(side.k, textures.color(object, "k", Spectrum(1)));
    for (const auto& [name, value] : {std::pair{"eta", side.eta}, std::pair{"k", side.k}}) {
      if (value.maximum().max_component() > 1e6f)
        return located("values up to 1e6 are supported", object, name);
    }
    if (side.kind == BsdfKind::conductor) return side;

    const std::string distribution = object.get_string("distribution", "beckmann");
    if (distribution != "beckmann" && distribution != "ggx") {
      return located("unknown distribution '" + distribution + "'; known: beckmann, ggx", object,
                     "distribution");
    }
    side.ggx = distribution == "ggx";
    side.sample_visible = object.get_bool("sample_visible", true);
    const auto given = [&](std::string_view name) {
      return object.find(name) != nullptr || object.find_child(name) != nullptr;
    };
    if (given("alpha_u") != given("alpha_v")) {
      return located("alpha_u and alpha_v go together", object, given("alpha_u") ? "alpha_u" : "alpha_v")
          .with_mend("give both, or alpha alone");
    }
    if (given("alpha_u") && given("alpha")) {
      return located("alpha excludes alpha_u and alpha_v", object, "alpha").with_mend("give either");
    }
    const bool anisotropic = given("alpha_u");
    CANDELA_ASSIGN(side.alpha_u, roughness(object, textures, anisotropic ? "alpha_u" : "alpha"));
    CANDELA_ASSIGN(side.alpha_v, roughness(object, textures, anisotropic ? "alpha_v" : "alpha"));
    return side;
  }
  return located("the bsdf plugin '" + plugin + "' is not supported", object, "");
}

Result<Bsdf> Bsdf::build(const description::Object& object, TextureStore& textures) {
  Bsdf bsdf;
  if (object.plugin != "twosided") {
    CANDELA_ASSIGN(Side side, build_side(object, textures));
    bsdf.sides_.push_back(std::move(side));
    return bsdf;
  }
  bsdf.two_sided_ = true;
  for (const auto& child : object.children_of("bsdf")) {
    if (child->plugin == "twosided") return located("twosided holds one-sided bsdfs", *child, "");
    if (child->plugin == "dielectric") {
      return located("twosided holds bsdfs that let no light through; dielectric does", *child, "")
          .with_mend("use the dielectric alone: it has two sides already");
    }
    CANDELA_ASSIGN(Side side, build_side(*child, textures));
    bsdf.sides_.push_back(std::move(side));
  }
  if (bsdf.sides_.empty() || bsdf.sides_.size() > 2) {
    return located(
        "twosided holds one bsdf, or two (front and back); here are " + std::to_string(bsdf.sides_.size()),
        object, "");
  }
  return bsdf;
}

Bsdf Bsdf::default_diffuse() {
  Bsdf bsdf;
  Side side;
  side.reflectance.constant = Spectrum(0.5f);
  bsdf.sides_.push_back(side);
  return bsdf;
}

Closure Bsdf::prepare(const SurfaceHit& hit, Vec3 wo_world) const {
  Closure closure;
  const Side* side = &sides_.front();
  const bool behind = dot(wo_world, hit.shading.n) < 0;
  closure.kind = side->kind;
  if (behind && side->kind != BsdfKind::dielectric) {
    if (!two_sided_) {
      closure.black = true;
      return closure;
    }
    side = &sides_.back();
    closure.kind = side->kind;
    closure.flipped = true;
  }
  const Spectrum reflectance = side->reflectance.eval(hit.uv);
  closure.black = reflectance.is_black();
  // Mitsuba's least roughness: below it the lobe is narrower than float directions resolve.
  const auto alpha = [&](const FloatTexture& texture) { return std::max(1e-4f, texture.eval(hit.uv)); };
  switch (side->kind) {
    case BsdfKind::diffuse:
      closure.diffuse = {reflectance};
      break;
    case BsdfKind::dielectric: {
      const Spectrum transmittance = side->transmittance.eval(hit.uv);
      closure.black = closure.black && transmittance.is_black();
      closure.dielectric = {reflectance, transmittance, side->relative_eta};
      break;
    }
    case BsdfKind::conductor:
      closure.conductor = {reflectance, side->eta.eval(hit.uv), side->k.eval(hit.uv)};
      break;
    case BsdfKind::roughconductor:
      closure.rough_conductor = {reflectance,          side->eta.eval(hit.uv), side->k.eval(hit.uv),
                                 alpha(side->alpha_u), alpha(side->alpha_v),   side->ggx,
                                 side->sample_visible};
      break;
  }
  return closure;
}

std::string_view Bsdf::kind_name(BsdfKind kind) {
  switch (kind) {
    case BsdfKind::diffuse:
      return "diffuse";
    case BsdfKind::dielectric:
      return "dielectric";
    case BsdfKind::conductor:
      return "conductor";
    case BsdfKind::roughconductor:
      return "roughconductor";
  }
  return "";
}

namespace {
bool is_delta(BsdfKind kind) {
  return kind == BsdfKind::dielectric || kind == BsdfKind::conductor;
}
}  // namespace

bool Bsdf::any_delta() const {
  return std::any_of(sides_.begin(), sides_.end(),
                     [](const Side& s) { return is_delta(s.kind) && !s.black(); });
}
bool Bsdf::all_delta() const {
  return std::all_of(sides_.begin(), sides_.end(),
                     [](const Side& s) { return is_delta(s.kind) || s.black(); });
}
bool Bsdf::transmissive() const {
  return sides_.front().kind == BsdfKind::dielectric && !sides_.front().transmittance.maximum().is_black();
}
bool Bsdf::black() const {
  return std::all_of(sides_.begin(), sides_.end(), [](const Side& s) { return s.black(); });
}
float Bsdf::max_albedo() const {
  float most = 0;
  for (const Side& s : sides_) {
    most = std::max(most, s.reflectance.maximum().max_component());
    if (s.kind == BsdfKind::dielectric) most = std::max(most, s.transmittance.maximum().max_component());
  }
  return most;
}
float Bsdf::min_roughness() const {
  float least = 1;
  for (const Side& s : sides_) {
    if (is_delta(s.kind)) least = 0;
    if (s.kind == BsdfKind::roughconductor) {
      least = std::min(least, std::max(1e-4f, std::min(s.alpha_u.minimum(), s.alpha_v.minimum())));
    }
  }
  return least;
}

}  // namespace candela::scene
