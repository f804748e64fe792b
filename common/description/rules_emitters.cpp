// Emitters, from Mitsuba's documentation: what is here is what Candela renders.
#include "common/description/rules.h"

namespace candela::description::rules {

namespace {

PropertyRule luminous_power(std::string_view doc) {
  return {.name = "power", .types = {number}, .doc = doc, .minimum = 0, .above_minimum = true};
}

// 0.6's emitters of daylight, by what they have beside the position of the sun.
PluginRule daylight(std::string_view name, std::vector<PropertyRule> own, std::string_view doc,
                    std::string_view differs) {
  const auto whole = [](std::string_view parameter, std::string_view meaning, double low, double high) {
    return PropertyRule{
        .name = parameter, .types = {integer}, .doc = meaning, .minimum = low, .maximum = high};
  };
  const auto real = [](std::string_view parameter, std::string_view meaning, double low, double high) {
    return PropertyRule{
        .name = parameter, .types = {number}, .doc = meaning, .minimum = low, .maximum = high};
  };
  std::vector<PropertyRule> rules = {
      real("turbidity", "haze: 2 very clear, 3 clear, 6 warm and moist, 10 hazy (default 3)", 1, 10),
      {.name = "sun_direction",
       .types = {vector},
       .doc = "direction to the sun in the world, without to_world; default: by date, time and place"},
      whole("year", "(default 2010)", 1900, 2100),
      whole("month", "(default 7)", 1, 12),
      whole("day", "(default 10)", 1, 31),
      real("hour", "(default 15)", 0, 24),
      real("minute", "(default 0)", 0, 60),
      real("second", "(default 0)", 0, 60),
      real("latitude", "degrees to the north (default 35.6894, Tokyo)", -90, 90),
      real("longitude", "degrees to the east (default 139.6917)", -180, 180),
      real("timezone", "hours before UTC (default 9)", -14, 14),
      whole("resolution", "columns of the image that the light becomes (default 512)", 8, 8192),
      to_world("turns the sky from +y"),
      sampling_weight()};
  rules.insert(rules.end(), own.begin(), own.end());
  return {.category = "emitter",
          .name = name,
          .properties = std::move(rules),
          .child_categories = {"medium"},
          .doc = doc,
          .differs = differs};
}

void add_daylight(std::vector<PluginRule>& table) {
  const auto factor = [](std::string_view name) {
    return PropertyRule{.name = name, .types = {number}, .doc = "factor (default 1)", .minimum = 0};
  };
  const PropertyRule stretch = {.name = "stretch",
                                .types = {number},
                                .doc = "lets the sky reach below the horizon: 2 to the nadir (default 1)",
                                .minimum = 1,
                                .maximum = 2};
  const PropertyRule albedo = {
      .name = "albedo",
      .types = {rgb},
      .doc = "albedo of the ground, which lights the sky (default 0.3; 0.2 in 0.6's files)",
      .minimum = 0,
      .maximum = 1};
  const PropertyRule radius = {.name = "sun_radius_scale",
                               .types = {number},
                               .doc = "widens the sun and keeps its power (default 1; at least 0.01)",
                               .minimum = 0};
  const PropertyRule aperture = {
      .name = "sun_aperture",
      .types = {number},
      .doc = "3: degrees from edge to edge of the sun, whose power stays; excludes sun_radius_scale",
      .minimum = 0,
      .maximum = 90,
      .above_minimum = true};
  const std::string_view sky =
      "the sky is fitted to radiances of 0.6: directions differ by 0.3 % (root mean square); Mitsuba 3's sky "
      "has +z up";
  const std::string_view sun =
      "the sun is a black body of 5778 K behind Rayleigh and aerosol scattering, without ozone, gases or "
      "vapor; it is at least as wide as a pixel of the image";
  table.push_back(daylight("sky", {factor("scale"), stretch, albedo},
                           "a clear sky without the sun after Hosek and Wilkie 2012", sky));
  table.push_back(daylight("sun", {factor("scale"), radius}, "the sun through the atmosphere", sun));
  table.push_back(daylight("sunsky",
                           {factor("sky_scale"), factor("sun_scale"), radius, aperture, stretch, albedo},
                           "sky and sun together", sky));
}

}  // namespace

void add_emitters(std::vector<PluginRule>& table) {
  table.push_back(
      {.category = "emitter",
       .name = "area",
       .properties =
           {textured(non_negative_rgb("radiance", "W/(m^2 sr), towards the normal's side (default 1)")),
            luminous_power(
                "Candela's addition: luminance of all light that leaves the shape, in W; scales the light"),
            sampling_weight()},
       .child_categories = {},
       .doc = "makes its shape a diffuse emitter; only inside a shape"});
  table.push_back({.category = "emitter",
                   .name = "point",
                   .properties = {non_negative_rgb("intensity", "W/sr (default 1)"),
                                  {.name = "position",
                                   .types = {point},
                                   .doc = "in world space; instead of to_world (default 0, 0, 0)"},
                                  to_world("moves the light from the origin"),
                                  sampling_weight()},
                   .child_categories = {"medium"},
                   .doc = "shines evenly into all directions"});
  table.push_back(
      {.category = "emitter",
       .name = "spot",
       .properties =
           {non_negative_rgb("intensity", "W/sr along the axis (default 1)"),
            {.name = "cutoff_angle",
             .types = {number},
             .doc = "degrees from the axis beyond which it is dark (default 20)",
             .minimum = 0,
             .maximum = 180,
             .above_minimum = true},
            {.name = "beam_width",
             .types = {number},
             .doc =
                 "degrees from the axis up to which intensity is full; from there to cutoff_angle it falls "
                 "linearly in the angle (default 3/4 of cutoff_angle)",
             .minimum = 0,
             .maximum = 180},
            textured({.name = "texture",
                      .types = {rgb},
                      .doc = "factor, projected along the axis; it spans the square around the cone's circle",
                      .minimum = 0}),
            to_world("moves and turns the light from the origin and +z"),
            sampling_weight()},
       .child_categories = {"medium"},
       .doc = "a point that shines into a cone"});
  std::vector<PropertyRule> projector = field_of_view("picture axis of fov (default x)");
  projector.insert(projector.begin(),
                   {textured(non_negative_rgb("irradiance",
                                              "the picture: irradiance over pi, W/m^2, of the "
                                              "plane at distance 1 (default 1)")),
                    {.name = "scale", .types = {number}, .doc = "factor (default 1)", .minimum = 0},
                    {.name = "quantity",
                     .types = {string},
                     .values = {"irradiance", "intensity"},
                     .doc = "Candela's addition: intensity, as in pbrt: the picture is W/sr (default "
                            "irradiance)"},
                    luminous_power("Candela's addition: luminance of the light, in W; overrides scale")});
  projector.push_back(to_world("that of a camera that sees the picture: along +z, +y is up, +x to the left"));
  projector.push_back(sampling_weight());
  table.push_back({.category = "emitter",
                   .name = "projector",
                   .properties = std::move(projector),
                   .child_categories = {"medium"},
                   .doc = "a point that projects a picture, as a pinhole camera would see it"});
  table.push_back(
      {.category = "emitter",
       .name = "goniometric",
       .properties =
           {file("square picture of all directions that keeps areas, as in pbrt; +y is in its middle, +x to "
                 "the right, +z below; the mean of red, green and blue counts; at most 2048 pixels a side"),
            non_negative_rgb("intensity", "W/sr where the picture is 1 (default 1)"),
            luminous_power("luminance of the light, in W; scales the light"),
            to_world("moves and turns the light"), sampling_weight()},
       .child_categories = {"medium"},
       .doc = "Candela's addition, as in pbrt: a point whose light follows a picture of its directions"});
  table.push_back(
      {.category = "emitter",
       .name = "directional",
       .properties = {non_negative_rgb("irradiance", "W/m^2 on a plane facing the light (default 1)"),
                      {.name = "direction",
                       .types = {vector},
                       .doc = "that the light travels along; instead of to_world (default 0, 0, 1)"},
                      to_world("turns the direction from +z"),
                      sampling_weight()},
       .child_categories = {"medium"},
       .doc = "parallel light from infinitely far"});
  table.push_back({.category = "emitter",
                   .name = "constant",
                   .properties = {non_negative_rgb("radiance", "W/(m^2 sr) (default 1)"), sampling_weight()},
                   .child_categories = {"medium"},
                   .doc = "the same light from everywhere"});
  table.push_back(
      {.category = "emitter",
       .name = "envmap",
       .properties = {file("latitude-longitude image, +y up"),
                      {.name = "mapping",
                       .types = {string},
                       .values = {"latlong", "equalarea"},
                       .doc =
                           "Candela's addition: equalarea is pbrt's square picture, +z up (default latlong)"},
                      {.name = "scale", .types = {number}, .doc = "factor (default 1)", .minimum = 0},
                      {.name = "illuminance",
                       .types = {number},
                       .doc = "Candela's addition, with equalarea: luminance on a plane that faces its +z, "
                              "in W/m^2; overrides scale",
                       .minimum = 0,
                       .above_minimum = true},
                      to_world("turns the environment (default identity)"),
                      sampling_weight(),
                      ignored("mis_compensation", {boolean}, "changes only noise"),
                      only("gamma", number, "-1", "0.6: the file's own encoding decides"),
                      ignored("cache", {boolean}, "0.6: no cache files are written")},
       .child_categories = {"medium"},
       .doc = "light from an image at infinity"});
  add_daylight(table);
}

}  // namespace candela::description::rules
