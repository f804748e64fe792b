// Emitters, from Mitsuba's documentation: what is here is what Candela renders.
#include "common/description/rules.h"

namespace candela::description::rules {

namespace {

// 0.6's emitters of daylight, by what they have beside the position of the sun.
void add_daylight(Plugins& emitters, std::string_view name, const std::vector<PropertyRule>& own,
                  std::string_view doc, std::string_view differs) {
  std::vector<PropertyRule> rules = {
      value("turbidity", {number}, "haze: 2 very clear, 3 clear, 6 warm and moist, 10 hazy (default 3)", 1,
            10),
      value("sun_direction", {vector},
            "direction to the sun in the world, without to_world; default: by date, time and place"),
      value("year", {integer}, "(default 2010)", 1900, 2100),
      value("month", {integer}, "(default 7)", 1, 12),
      value("day", {integer}, "(default 10)", 1, 31),
      value("hour", {number}, "(default 15)", 0, 24),
      value("minute", {number}, "(default 0)", 0, 60),
      value("second", {number}, "(default 0)", 0, 60),
      value("latitude", {number}, "degrees to the north (default 35.6894, Tokyo)", -90, 90),
      value("longitude", {number}, "degrees to the east (default 139.6917)", -180, 180),
      value("timezone", {number}, "hours before UTC (default 9)", -14, 14),
      value("resolution", {integer}, "columns of the image that the light becomes (default 512)", 8, 8192),
      to_world("turns the sky from +y"),
      sampling_weight()};
  rules.insert(rules.end(), own.begin(), own.end());
  emitters.add(name, doc, std::move(rules), {"medium"}, differs);
}

void add_daylight(Plugins& emitters) {
  const auto factor = [](std::string_view name) { return value(name, {number}, "factor (default 1)", 0); };
  const PropertyRule stretch =
      value("stretch", {number}, "lets the sky reach below the horizon: 2 to the nadir (default 1)", 1, 2);
  const PropertyRule albedo = value(
      "albedo", {rgb}, "albedo of the ground, which lights the sky (default 0.3; 0.2 in 0.6's files)", 0, 1);
  const PropertyRule radius =
      value("sun_radius_scale", {number}, "widens the sun and keeps its power (default 1; at least 0.01)", 0);
  const PropertyRule aperture = above(
      value("sun_aperture", {number},
            "3: degrees from edge to edge of the sun, whose power stays; excludes sun_radius_scale", 0, 90));
  const std::string_view sky =
      "the sky is fitted to radiances of 0.6: directions differ by 0.3 % (root mean square); Mitsuba 3's sky "
      "has +z up";
  const std::string_view sun =
      "the sun is a black body of 5778 K behind Rayleigh and aerosol scattering, without ozone, gases or "
      "vapor; it is at least as wide as a pixel of the image";
  add_daylight(emitters, "sky", {factor("scale"), stretch, albedo},
               "a clear sky without the sun after Hosek and Wilkie 2012", sky);
  add_daylight(emitters, "sun", {factor("scale"), radius}, "the sun through the atmosphere", sun);
  add_daylight(emitters, "sunsky",
               {factor("sky_scale"), factor("sun_scale"), radius, aperture, stretch, albedo},
               "sky and sun together", sky);
}

}  // namespace

void add_emitters(std::vector<PluginRule>& table) {
  Plugins emitters(table, "emitter", {"medium"});
  emitters.add(
      "area", "makes its shape a diffuse emitter; only inside a shape",
      {textured(non_negative_rgb("radiance", "W/(m^2 sr), towards the normal's side (default 1)")),
       positive("power",
                "Candela's addition: luminance of all light that leaves the shape, in W; scales the light"),
       sampling_weight()},
      {});
  emitters.add("point", "shines evenly into all directions",
               {non_negative_rgb("intensity", "W/sr (default 1)"),
                value("position", {point}, "in world space; instead of to_world (default 0, 0, 0)"),
                to_world("moves the light from the origin"), sampling_weight()});
  emitters.add(
      "spot", "a point that shines into a cone",
      {non_negative_rgb("intensity", "W/sr along the axis (default 1)"),
       above(value("cutoff_angle", {number}, "degrees from the axis beyond which it is dark (default 20)", 0,
                   180)),
       value("beam_width", {number},
             "degrees from the axis up to which intensity is full; from there to cutoff_angle it falls "
             "linearly in the angle (default 3/4 of cutoff_angle)",
             0, 180),
       textured(non_negative_rgb(
           "texture", "factor, projected along the axis; it spans the square around the cone's circle")),
       to_world("moves and turns the light from the origin and +z"), sampling_weight()});
  std::vector<PropertyRule> projector = field_of_view("picture axis of fov (default x)");
  projector.insert(projector.begin(),
                   {textured(non_negative_rgb("irradiance",
                                              "the picture: irradiance over pi, W/m^2, of the "
                                              "plane at distance 1 (default 1)")),
                    value("scale", {number}, "factor (default 1)", 0),
                    choice("quantity", {"irradiance", "intensity"},
                           "Candela's addition: intensity, as in pbrt: the picture is W/sr (default "
                           "irradiance)"),
                    positive("power", "Candela's addition: luminance of the light, in W; overrides scale")});
  projector.push_back(to_world("that of a camera that sees the picture: along +z, +y is up, +x to the left"));
  projector.push_back(sampling_weight());
  emitters.add("projector", "a point that projects a picture, as a pinhole camera would see it",
               std::move(projector));
  emitters.add(
      "goniometric",
      "Candela's addition, as in pbrt: a point whose light follows a picture of its directions",
      {file("square picture of all directions that keeps areas, as in pbrt; +y is in its middle, +x to "
            "the right, +z below; the mean of red, green and blue counts; at most 2048 pixels a side"),
       non_negative_rgb("intensity", "W/sr where the picture is 1 (default 1)"),
       positive("power", "luminance of the light, in W; scales the light"),
       to_world("moves and turns the light"), sampling_weight()});
  emitters.add(
      "directional", "parallel light from infinitely far",
      {non_negative_rgb("irradiance", "W/m^2 on a plane facing the light (default 1)"),
       value("direction", {vector}, "that the light travels along; instead of to_world (default 0, 0, 1)"),
       to_world("turns the direction from +z"), sampling_weight()});
  emitters.add("constant", "the same light from everywhere",
               {non_negative_rgb("radiance", "W/(m^2 sr) (default 1)"), sampling_weight()});
  emitters.add("envmap", "light from an image at infinity",
               {file("latitude-longitude image, +y up"),
                choice("mapping", {"latlong", "equalarea"},
                       "Candela's addition: equalarea is pbrt's square picture, +z up (default latlong)"),
                value("scale", {number}, "factor (default 1)", 0),
                positive("illuminance",
                         "Candela's addition, with equalarea: luminance on a plane that faces its +z, "
                         "in W/m^2; overrides scale"),
                to_world("turns the environment (default identity)"), sampling_weight(),
                ignored("mis_compensation", {boolean}, "changes only noise"),
                only("gamma", number, "-1", "0.6: the file's own encoding decides"),
                ignored("cache", {boolean}, "0.6: no cache files are written")});
  add_daylight(emitters);
}

}  // namespace candela::description::rules
