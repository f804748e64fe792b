#include "common/description/pbrt/media.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "common/description/check.h"
#include "common/description/media_presets.h"
#include "common/description/text.h"

namespace candela::description::pbrt {
namespace {

constexpr std::array<std::string_view, 5> medium_types = {"homogeneous", "uniformgrid", "rgbgrid", "cloud",
                                                          "nanovdb"};

Result<Vec3> coefficient(Context& context, ParameterList& parameters, std::string_view name,
                         const Vec3& otherwise, ColorSpace space) {
  const Parameter* parameter = parameters.take(name, {"rgb", "spectrum"});
  if (parameter == nullptr) return otherwise;
  CANDELA_ASSIGN(const Rgb rgb, color_of(context, *parameter, SpectrumUse::unbounded, space));
  return rgb.value;
}

}  // namespace

Result<ObjectPtr> scattering_medium(Context& context, ParameterList& parameters, std::string_view preset,
                                    ColorSpace space, const Location& where) {
  // pbrt's default is whole milk, per millimeter [Jensen et al. 2001].
  MediumPreset coefficients = *named_medium("wholemilk");
  CANDELA_ASSIGN(const std::string name, parameters.text(preset, ""));
  if (!name.empty()) {
    std::string folded = text::lower(name);
    std::erase(folded, ' ');
    if (const std::optional<MediumPreset> known = named_medium(folded)) {
      coefficients = *known;
    } else {
      CANDELA_TRY(context.refuse(Context::unknown(where, "medium", name, medium_names()),
                                 "it is read as whole milk"));
    }
  }
  CANDELA_ASSIGN(const Vec3 absorption,
                 coefficient(context, parameters, "sigma_a", coefficients.sigma_a, space));
  CANDELA_ASSIGN(const Vec3 scattering,
                 coefficient(context, parameters, "sigma_s", coefficients.sigma_s, space));
  CANDELA_ASSIGN(const double scale, parameters.number("scale", 1));
  CANDELA_ASSIGN(const double g, parameters.number("g", 0));
  Rgb extinction, albedo;
  for (std::size_t i = 0; i < 3; ++i) {
    extinction.value[i] = absorption[i] + scattering[i];
    albedo.value[i] = extinction.value[i] > 0 ? scattering[i] / extinction.value[i] : 0;
  }
  std::shared_ptr<Object> medium = make("medium", "homogeneous", where);
  set(*medium, "sigma_t", extinction);
  set(*medium, "albedo", albedo);
  set(*medium, "scale", scale);
  if (g != 0) {
    std::shared_ptr<Object> phase = make("phase", "hg", where);
    set(*phase, "g", g);
    CANDELA_ASSIGN(ObjectPtr finished, Context::finish(std::move(phase)));
    add(*medium, "", std::move(finished));
  }
  return Context::finish(std::move(medium));
}

Result<void> Media::define(const std::string& name, ParameterList parameters, ColorSpace space,
                           const Location& where) {
  if (const auto known = media_.find(name); known != media_.end()) {
    const Location& first = known->second->where;
    return error_at(where, fmt::format("the medium {} is defined since {}:{}", text::quote(name), first.file,
                                       first.line));
  }
  CANDELA_ASSIGN(const std::string type, parameters.text("type", ""));
  const bool known = std::find(medium_types.begin(), medium_types.end(), type) != medium_types.end();
  if (!known) {
    CANDELA_TRY(context_.refuse(Context::unknown(where, "medium", type, medium_types),
                                "it is read as 'homogeneous'"));
  } else if (type != "homogeneous") {
    CANDELA_TRY(context_.refuse(error_at(where, fmt::format("medium '{}' is not supported yet", type)),
                                "it is read as 'homogeneous'"));
  }
  if (parameters.has("Le")) {
    CANDELA_TRY(context_.refuse(error_at(where, "a medium that glows is not supported yet"), "it is dark"));
    parameters.ignore({"Le", "Lescale"});
  }
  CANDELA_ASSIGN(ObjectPtr medium, scattering_medium(context_, parameters, "preset", space, where));
  if (type == "homogeneous")
    CANDELA_TRY(context_.refuse_unused(parameters, fmt::format("medium '{}'", type)));
  media_.emplace(name, std::move(medium));
  return {};
}

Result<ObjectPtr> Media::medium(const std::string& name, const Location& where) const {
  if (name.empty()) return ObjectPtr();
  const auto found = media_.find(name);
  if (found != media_.end()) return found->second;
  std::vector<std::string_view> known;
  for (const auto& [other, unused] : media_) known.push_back(other);
  return Context::unknown(where, "medium", name, known);
}

}  // namespace candela::description::pbrt
