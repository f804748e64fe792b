// Emitters, from Mitsuba's documentation: what is here is what Candela renders.
#include "common/description/rules.h"

namespace candela::description::rules {

void add_emitters(std::vector<PluginRule>& table) {
  table.push_back({.category = "emitter",
                   .name = "area",
                   .properties = {textured(non_negative_rgb(
                                      "radiance", "W/(m^2 sr), towards the normal's side (default 1)")),
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
       .child_categories = {},
       .doc = "a point that shines into a cone"});
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
                      {.name = "scale", .types = {number}, .doc = "factor (default 1)", .minimum = 0},
                      to_world("turns the environment (default identity)"),
                      sampling_weight(),
                      ignored("mis_compensation", {boolean},
                              "a way of sampling: noise only, the mean is the same"),
                      only("gamma", number, "-1", "0.6: the file's own encoding decides"),
                      ignored("cache", {boolean}, "0.6: no cache files are written")},
       .child_categories = {"medium"},
       .doc = "light from an image at infinity"});
}

}  // namespace candela::description::rules
