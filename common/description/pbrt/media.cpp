#include "common/description/pbrt/media.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "common/description/check.h"
#include "common/description/media_presets.h"
#include "common/description/text.h"
#include "common/description/transform.h"

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

std::pair<Rgb, Rgb> extinction_and_albedo(const Vec3& absorption, const Vec3& scattering) {
  Rgb extinction, albedo;
  for (std::size_t i = 0; i < 3; ++i) {
    extinction.value[i] = absorption[i] + scattering[i];
    albedo.value[i] = extinction.value[i] > 0 ? scattering[i] / extinction.value[i] : 0;
  }
  return {extinction, albedo};
}

Result<void> add_phase(Object& medium, double g) {
  if (g == 0) return {};
  std::shared_ptr<Object> phase = make("phase", "hg", medium.where);
  set(*phase, "g", g);
  CANDELA_ASSIGN(ObjectPtr finished, Context::finish(std::move(phase)));
  add(medium, "", std::move(finished));
  return {};
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
  const auto [extinction, albedo] = extinction_and_albedo(absorption, scattering);
  std::shared_ptr<Object> medium = make("medium", "homogeneous", where);
  set(*medium, "sigma_t", extinction);
  set(*medium, "albedo", albedo);
  set(*medium, "scale", scale);
  CANDELA_TRY(add_phase(*medium, g));
  return Context::finish(std::move(medium));
}

// The densities stay in the scene's file. Beyond the outermost centers of cells pbrt's grid falls to 0.
Result<ObjectPtr> Media::uniform_grid(MediumEntity& entity) {
  ParameterList& parameters = entity.parameters;
  if (entity.has_shared_values)
    return error_at(entity.where, "a parameter of a medium 'uniformgrid' given by Attribute is not supported")
        .with_mend("write it into the MakeNamedMedium directive");
  if (parameters.has("temperature")) {
    CANDELA_TRY(
        context_.refuse(error_at(entity.where, "a medium that glows is not supported yet"), "it is dark"));
    parameters.ignore({"temperature", "temperaturescale", "temperatureoffset"});
  }
  CANDELA_ASSIGN(const Vec3 p0, parameters.point("p0", {0, 0, 0}));
  CANDELA_ASSIGN(const Vec3 p1, parameters.point("p1", {1, 1, 1}));
  Vec3 low{}, extent{};
  for (std::size_t i = 0; i < 3; ++i) {
    low[i] = std::min(p0[i], p1[i]);
    extent[i] = std::max(p0[i], p1[i]) - low[i];
    if (!(extent[i] > 0)) return error_at(entity.where, "the medium's box from p0 to p1 has no volume");
  }
  parameters.ignore({"density", "nx", "ny", "nz"});
  CANDELA_ASSIGN(const Vec3 absorption,
                 coefficient(context_, parameters, "sigma_a", {1, 1, 1}, entity.space));
  CANDELA_ASSIGN(const Vec3 scattering,
                 coefficient(context_, parameters, "sigma_s", {1, 1, 1}, entity.space));
  CANDELA_ASSIGN(const double scale, parameters.number("scale", 1));
  CANDELA_ASSIGN(const double g, parameters.number("g", 0));
  const auto [extinction, albedo] = extinction_and_albedo(absorption, scattering);
  const std::shared_ptr<Object> grid = make("volume", "gridvolume", entity.where);
  set(*grid, "filename", entity.where.file);
  set_integer(*grid, "offset", static_cast<std::int64_t>(entity.offset));
  set(*grid, "factor", extinction);
  set(*grid, "wrap_mode", std::string("zero"));
  set(*grid, "to_world",
      transform::multiply(entity.to_world,
                          transform::multiply(transform::translate(low), transform::scale(extent))));
  CANDELA_ASSIGN(ObjectPtr finished, Context::finish(grid));
  std::shared_ptr<Object> medium = make("medium", "heterogeneous", entity.where);
  add(*medium, "sigma_t", std::move(finished));
  set(*medium, "albedo", albedo);
  set(*medium, "scale", scale);
  CANDELA_TRY(add_phase(*medium, g));
  return Context::finish(std::move(medium));
}

Result<void> Media::define(MediumEntity entity) {
  const std::string& name = entity.name;
  const Location& where = entity.where;
  ParameterList& parameters = entity.parameters;
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
  } else if (type != "homogeneous" && type != "uniformgrid") {
    CANDELA_TRY(context_.refuse(error_at(where, fmt::format("medium '{}' is not supported yet", type)),
                                "it is read as 'homogeneous'"));
  }
  if (parameters.has("Le")) {
    CANDELA_TRY(context_.refuse(error_at(where, "a medium that glows is not supported yet"), "it is dark"));
    parameters.ignore({"Le", "Lescale"});
  }
  const auto read = [&]() {
    return type == "uniformgrid" ? uniform_grid(entity)
                                 : scattering_medium(context_, parameters, "preset", entity.space, where);
  };
  CANDELA_ASSIGN(ObjectPtr medium, read());
  if (type == "homogeneous" || type == "uniformgrid")
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
