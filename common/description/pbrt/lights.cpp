// All lights of pbrt but those of rgb colors are scaled to a luminance of 1 before `scale` and `power`, and a
// film of the sensor "cie1931" shows a radiance of rgb (1, 1, 1) as 1: values are taken over as they are.
#include "common/description/pbrt/lights.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <numbers>

#include "common/description/check.h"
#include "common/description/pbrt/geometry.h"
#include "common/description/text.h"
#include "common/description/transform.h"

namespace candela::description::pbrt {
namespace {

constexpr std::array<std::string_view, 6> light_types = {"point",    "spot",       "distant",
                                                         "infinite", "projection", "goniometric"};

Rgb times(const Rgb& rgb, double factor) {
  return {{rgb.value[0] * factor, rgb.value[1] * factor, rgb.value[2] * factor}};
}

// The light's spectrum times its scale. `unit`: what `power` or `illuminance` divides by, the power or
// illuminance of the light without it.
Result<Rgb> emission(Context& context, LightEntity& entity, std::string_view name, std::string_view quantity,
                     double unit) {
  const Parameter* spectrum = entity.parameters.take(name, {"rgb", "spectrum", "blackbody"});
  Rgb light{{1, 1, 1}};
  if (spectrum != nullptr) {
    CANDELA_ASSIGN(light, light_of(context, *spectrum, entity.space));
  }
  CANDELA_ASSIGN(const double scale, entity.parameters.number("scale", 1));
  double factor = scale * entity.factor;
  if (!quantity.empty()) {
    CANDELA_ASSIGN(const double wanted, entity.parameters.number(quantity, -1));
    if (wanted > 0) factor *= wanted / unit;
  }
  return times(light, factor);
}

Result<ObjectPtr> point(Context& context, LightEntity& entity) {
  const std::shared_ptr<Object> light = make("emitter", "point", entity.where);
  CANDELA_ASSIGN(const Rgb intensity, emission(context, entity, "I", "power", 4 * std::numbers::pi));
  CANDELA_ASSIGN(const Vec3 from, entity.parameters.point("from", {0, 0, 0}));
  set(*light, "intensity", intensity);
  set_point(*light, "position", transform_point(entity.to_world, from));
  if (entity.medium) add(*light, "", entity.medium);
  return context.finish(light);
}

Result<ObjectPtr> spot(Context& context, LightEntity& entity) {
  const std::shared_ptr<Object> light = make("emitter", "spot", entity.where);
  CANDELA_ASSIGN(const double cone, entity.parameters.number("coneangle", 30));
  CANDELA_ASSIGN(const double delta, entity.parameters.number("conedeltaangle", 5));
  const double start = std::max(cone - delta, 0.0);
  const double cos_start = cosine_degrees(start), cos_end = cosine_degrees(cone);
  const double unit = 2 * std::numbers::pi * ((1 - cos_start) + (cos_start - cos_end) / 2);
  CANDELA_ASSIGN(const Rgb intensity, emission(context, entity, "I", "power", unit));
  CANDELA_ASSIGN(const Vec3 from, entity.parameters.point("from", {0, 0, 0}));
  CANDELA_ASSIGN(const Vec3 to, entity.parameters.point("to", {0, 0, 1}));
  const std::optional<Mat4> aim = transform::look_at(from, to, {0, 0, 0});
  if (!aim) return error_at(entity.where, "'from' and 'to' of the spot light are the same point");
  set(*light, "intensity", intensity);
  set(*light, "cutoff_angle", cone);
  set(*light, "beam_width", start);
  set(*light, "to_world", transform::multiply(entity.to_world, *aim));
  context.differs(
      entity.where,
      "the edge of a spot light falls off linearly in the angle, where pbrt has a smooth step in its "
      "cosine");
  return context.finish(light);
}

Result<ObjectPtr> distant(Context& context, LightEntity& entity) {
  const std::shared_ptr<Object> light = make("emitter", "directional", entity.where);
  CANDELA_ASSIGN(const Rgb irradiance, emission(context, entity, "L", "illuminance", 1));
  CANDELA_ASSIGN(const Vec3 from, entity.parameters.point("from", {0, 0, 0}));
  CANDELA_ASSIGN(const Vec3 to, entity.parameters.point("to", {0, 0, 1}));
  set(*light, "irradiance", irradiance);
  set_point(*light, "direction",
            transform_vector(entity.to_world, {to[0] - from[0], to[1] - from[1], to[2] - from[2]}));
  return context.finish(light);
}

Result<ObjectPtr> infinite(Context& context, LightEntity& entity) {
  ParameterList& parameters = entity.parameters;
  CANDELA_ASSIGN(const std::string file, parameters.text("filename", ""));
  if (parameters.has("portal")) {
    context.differs(entity.where,
                    "the portal of an infinite light is passed over: light comes from everywhere");
    parameters.ignore({"portal"});
  }
  if (file.empty()) {
    const std::shared_ptr<Object> light = make("emitter", "constant", entity.where);
    CANDELA_ASSIGN(const Rgb radiance, emission(context, entity, "L", "illuminance", std::numbers::pi));
    set(*light, "radiance", radiance);
    return context.finish(light);
  }
  if (parameters.has("L"))
    return error_at(entity.where, "the light has both 'filename' and 'L'").with_mend("leave one of them out");
  const std::shared_ptr<Object> light = make("emitter", "envmap", entity.where);
  CANDELA_ASSIGN(const std::string key, context.find_file(entity.where, file));
  CANDELA_ASSIGN(const double scale, parameters.number("scale", 1));
  set(*light, "filename", key);
  set(*light, "mapping", std::string("equalarea"));
  CANDELA_ASSIGN(const double illuminance, parameters.number("illuminance", -1));
  if (illuminance > 0) {
    set(*light, "illuminance", illuminance * scale * entity.factor);
    context.differs(
        entity.where,
        "the picture of an infinite light has the given 'illuminance'; pbrt counts half of its light, "
        "and makes it twice as bright");
  } else {
    set(*light, "scale", scale * entity.factor);
  }
  set(*light, "to_world", entity.to_world);
  return context.finish(light);
}

Result<ObjectPtr> projection(Context& context, Textures& textures, LightEntity& entity) {
  ParameterList& parameters = entity.parameters;
  const std::shared_ptr<Object> light = make("emitter", "projector", entity.where);
  CANDELA_ASSIGN(const std::string file, parameters.text("filename", ""));
  if (file.empty())
    return error_at(entity.where, "light 'projection' needs a picture")
        .with_mend("write \"string filename\" \"picture.png\"");
  CANDELA_ASSIGN(ObjectPtr picture, textures.projected_picture(entity.where, file));
  CANDELA_ASSIGN(const double fov, parameters.number("fov", 90));
  if (!(fov > 0 && fov < 180))
    return error_at(entity.where, fmt::format("fov {} is not within 0 and 180", fov));
  CANDELA_ASSIGN(const double scale, parameters.number("scale", 1));
  CANDELA_ASSIGN(const double power, parameters.number("power", -1));
  add(*light, "irradiance", std::move(picture));
  if (power > 0)
    set(*light, "power", power * scale * entity.factor);
  else
    set(*light, "scale", scale * entity.factor);
  set(*light, "quantity", std::string("intensity"));
  set(*light, "fov", fov);
  set(*light, "fov_axis", std::string("smaller"));
  // The picture's right is +x in pbrt, and -x in Mitsuba.
  set(*light, "to_world", transform::multiply(entity.to_world, transform::scale({-1, 1, 1})));
  if (entity.medium) add(*light, "", entity.medium);
  return context.finish(light);
}

Result<ObjectPtr> goniometric(Context& context, LightEntity& entity) {
  ParameterList& parameters = entity.parameters;
  CANDELA_ASSIGN(const std::string file, parameters.text("filename", ""));
  if (file.empty()) {
    context.differs(entity.where, "a goniometric light without a picture is a point light");
    return point(context, entity);
  }
  const std::shared_ptr<Object> light = make("emitter", "goniometric", entity.where);
  CANDELA_ASSIGN(const std::string key, context.find_file(entity.where, file));
  CANDELA_ASSIGN(const Rgb intensity, emission(context, entity, "I", "", 1));
  CANDELA_ASSIGN(const double power, parameters.number("power", -1));
  set(*light, "filename", key);
  set(*light, "intensity", intensity);
  const double total = power * luminance(intensity.value);
  if (total > 0) set(*light, "power", total);
  set(*light, "to_world", entity.to_world);
  if (entity.medium) add(*light, "", entity.medium);
  return context.finish(light);
}

}  // namespace

Result<ObjectPtr> build_light(Context& context, Textures& textures, LightEntity& entity) {
  const auto make_light = [&]() -> Result<ObjectPtr> {
    if (entity.type == "point") return point(context, entity);
    if (entity.type == "spot") return spot(context, entity);
    if (entity.type == "distant") return distant(context, entity);
    if (entity.type == "infinite") return infinite(context, entity);
    if (entity.type == "projection") return projection(context, textures, entity);
    if (entity.type == "goniometric") return goniometric(context, entity);
    CANDELA_TRY(context.refuse(Context::unknown(entity.where, "light", entity.type, light_types),
                               "it is read as 'point'"));
    CANDELA_ASSIGN(ObjectPtr light, point(context, entity));
    entity.parameters = {};
    return light;
  };
  CANDELA_ASSIGN(ObjectPtr light, make_light());
  CANDELA_TRY(context.refuse_unused(entity.parameters, fmt::format("light '{}'", entity.type)));
  return light;
}

Result<ObjectPtr> build_area_light(Context& context, Textures& textures, LightEntity& entity) {
  ParameterList& parameters = entity.parameters;
  if (entity.type != "diffuse")
    CANDELA_TRY(context.refuse(
        Context::unknown(entity.where, "area light", entity.type, std::array<std::string_view, 1>{"diffuse"}),
        "it is read as 'diffuse'"));
  CANDELA_ASSIGN(const bool two_sided, parameters.flag("twosided", false));
  if (two_sided)
    context.differs(entity.where, "the area light glows on the side of its normal alone, not on both");
  const std::shared_ptr<Object> light = make("emitter", "area", entity.where);
  CANDELA_ASSIGN(const Rgb radiance, emission(context, entity, "L", "", 1));
  CANDELA_ASSIGN(const std::string file, parameters.text("filename", ""));
  CANDELA_ASSIGN(const double power, parameters.number("power", -1));
  // Half of the power of both sides leaves the one that glows here. pbrt's `scale` counts beside it.
  const double total = power * luminance(radiance.value) / (two_sided ? 2 : 1);
  if (total > 0) set(*light, "power", total);
  if (file.empty()) {
    set(*light, "radiance", radiance);
  } else {
    CANDELA_ASSIGN(ObjectPtr picture, textures.picture(entity.where, file, false));
    CANDELA_ASSIGN(const Value scaled,
                   textures.scaled({{}, std::move(picture), entity.where}, radiance.value));
    set_color(*light, "radiance", scaled);
  }
  CANDELA_TRY(context.refuse_unused(parameters, "area light 'diffuse'"));
  return context.finish(light);
}

}  // namespace candela::description::pbrt
