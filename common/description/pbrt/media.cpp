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

Result<void> add_phase(const Context& context, Object& medium, double g) {
  if (g == 0) return {};
  std::shared_ptr<Object> phase = make("phase", "hg", medium.where);
  set(*phase, "g", g);
  CANDELA_ASSIGN(ObjectPtr finished, context.finish(std::move(phase)));
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
  CANDELA_TRY(add_phase(context, *medium, g));
  return context.finish(std::move(medium));
}

// The extinction of a grid of densities, times the scale, and the albedo.
Result<std::shared_ptr<Object>> Media::grid_medium(MediumEntity& entity,
                                                   const std::shared_ptr<Object>& grid) {
  ParameterList& parameters = entity.parameters;
  CANDELA_ASSIGN(const Vec3 absorption,
                 coefficient(context_, parameters, "sigma_a", {1, 1, 1}, entity.space));
  CANDELA_ASSIGN(const Vec3 scattering,
                 coefficient(context_, parameters, "sigma_s", {1, 1, 1}, entity.space));
  const auto [extinction, albedo] = extinction_and_albedo(absorption, scattering);
  set(*grid, "factor", extinction);
  CANDELA_ASSIGN(ObjectPtr finished, context_.finish(grid));
  std::shared_ptr<Object> medium = make("medium", "heterogeneous", entity.where);
  add(*medium, "sigma_t", std::move(finished));
  set(*medium, "albedo", albedo);
  return medium;
}

// A grid whose values stay in the scene's file, or follow from its directive, over the box from p0 to p1.
// `read_by_loader`: parameters that the loader reads in the directive's own file.
Result<std::shared_ptr<Object>> Media::grid_in_box(MediumEntity& entity, std::string_view wrap,
                                                   std::initializer_list<std::string_view> read_by_loader) {
  ParameterList& parameters = entity.parameters;
  if (entity.has_shared_values)
    return error_at(entity.where,
                    "a parameter of a medium that is a grid, given by Attribute, is not supported")
        .with_mend("write it into the MakeNamedMedium directive");
  if (const Parameter* outside = parameters.given_outside(entity.where.file, read_by_loader))
    return error_at(outside->where,
                    fmt::format("parameter {} of the medium at {}:{} stands behind the end of its file",
                                text::quote(outside->name), entity.where.file, entity.where.line))
        .with_mend("write the grid into one file");
  CANDELA_ASSIGN(const Vec3 p0, parameters.point("p0", {0, 0, 0}));
  CANDELA_ASSIGN(const Vec3 p1, parameters.point("p1", {1, 1, 1}));
  Vec3 low{}, extent{};
  for (std::size_t i = 0; i < 3; ++i) {
    low[i] = std::min(p0[i], p1[i]);
    extent[i] = std::max(p0[i], p1[i]) - low[i];
    if (!(extent[i] > 0)) return error_at(entity.where, "the medium's box from p0 to p1 has no volume");
  }
  std::shared_ptr<Object> grid = make("volume", "gridvolume", entity.where);
  set(*grid, "filename", entity.where.file);
  set_integer(*grid, "offset", static_cast<std::int64_t>(entity.offset));
  set(*grid, "wrap_mode", std::string(wrap));
  set(*grid, "to_world",
      transform::multiply(entity.to_world,
                          transform::multiply(transform::translate(low), transform::scale(extent))));
  return grid;
}

Result<ObjectPtr> Media::finish_grid(MediumEntity& entity, std::shared_ptr<Object> medium) {
  CANDELA_ASSIGN(const double scale, entity.parameters.number("scale", 1));
  CANDELA_ASSIGN(const double g, entity.parameters.number("g", 0));
  set(*medium, "scale", scale);
  CANDELA_TRY(add_phase(context_, *medium, g));
  return context_.finish(std::move(medium));
}

// Beyond the outermost centers of cells pbrt's grid falls to 0.
Result<ObjectPtr> Media::uniform_grid(MediumEntity& entity) {
  CANDELA_ASSIGN(const std::shared_ptr<Object> grid,
                 grid_in_box(entity, "zero", {"nx", "ny", "nz", "density"}));
  entity.parameters.ignore({"density", "nx", "ny", "nz"});
  CANDELA_ASSIGN(std::shared_ptr<Object> medium, grid_medium(entity, grid));
  return finish_grid(entity, std::move(medium));
}

// Extinction and albedo are grids of their own.
Result<ObjectPtr> Media::rgb_grid(MediumEntity& entity) {
  if (entity.space != ColorSpace::srgb)
    context_.differs(entity.where, "the colors of a medium 'rgbgrid' are taken for Rec.709");
  std::shared_ptr<Object> medium = make("medium", "heterogeneous", entity.where);
  for (const std::string_view part : {"sigma_t", "albedo"}) {
    CANDELA_ASSIGN(
        const std::shared_ptr<Object> grid,
        grid_in_box(entity, part == "albedo" ? "clamp" : "zero", {"nx", "ny", "nz", "sigma_a", "sigma_s"}));
    set(*grid, "grid", std::string(part));
    CANDELA_ASSIGN(ObjectPtr finished, context_.finish(grid));
    add(*medium, part, std::move(finished));
  }
  entity.parameters.ignore({"sigma_a", "sigma_s", "nx", "ny", "nz"});
  return finish_grid(entity, std::move(medium));
}

Result<ObjectPtr> Media::cloud(MediumEntity& entity) {
  CANDELA_ASSIGN(const std::shared_ptr<Object> grid,
                 grid_in_box(entity, "zero", {"type", "density", "wispiness", "frequency", "p0", "p1"}));
  entity.parameters.ignore({"density", "wispiness", "frequency"});
  context_.differs(entity.where,
                   "the noise of a medium 'cloud' is sampled on a grid of 128 x 128 x 128 cells");
  CANDELA_ASSIGN(std::shared_ptr<Object> medium, grid_medium(entity, grid));
  return finish_grid(entity, std::move(medium));
}

Result<ObjectPtr> Media::nano_vdb(MediumEntity& entity) {
  ParameterList& parameters = entity.parameters;
  CANDELA_ASSIGN(const std::string file, parameters.text("filename", ""));
  CANDELA_ASSIGN(const std::string key, context_.find_file(entity.where, file));
  const std::shared_ptr<Object> grid = make("volume", "gridvolume", entity.where);
  set(*grid, "filename", key);
  set(*grid, "grid", std::string("density"));
  set_flag(*grid, "use_grid_bbox", true);
  set(*grid, "wrap_mode", std::string("zero"));
  set(*grid, "to_world", entity.to_world);
  context_.differs(entity.where, "a medium 'nanovdb' does not glow, if it has temperatures");
  parameters.ignore({"LeScale", "temperaturecutoff"});
  CANDELA_ASSIGN(std::shared_ptr<Object> medium, grid_medium(entity, grid));
  return finish_grid(entity, std::move(medium));
}

Result<ObjectPtr> Media::read(MediumEntity& entity, const std::string& type) {
  if (type == "uniformgrid") return uniform_grid(entity);
  if (type == "rgbgrid") return rgb_grid(entity);
  if (type == "cloud") return cloud(entity);
  if (type == "nanovdb") return nano_vdb(entity);
  return scattering_medium(context_, entity.parameters, "preset", entity.space, entity.where);
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
  if (!known)
    CANDELA_TRY(context_.refuse(Context::unknown(where, "medium", type, medium_types),
                                "it is read as 'homogeneous'"));
  for (const std::string_view glow : {"Le", "temperature"})
    if (parameters.has(glow))
      context_.differs(where, fmt::format("the medium does not glow: '{}' is passed over", glow));
  parameters.ignore({"Le", "Lescale", "temperature", "temperaturescale", "temperatureoffset"});
  CANDELA_ASSIGN(ObjectPtr medium, read(entity, type));
  if (known) CANDELA_TRY(context_.refuse_unused(parameters, fmt::format("medium '{}'", type)));
  const std::shared_ptr<Object> named = std::make_shared<Object>(*medium);
  named->id = name;
  media_.emplace(name, named);
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
