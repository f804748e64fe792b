// Textures, from Mitsuba's documentation: what is here is what Candela renders.
#include "common/description/rules.h"

namespace candela::description::rules {
namespace {

PropertyRule textured_color(std::string_view name, std::string_view doc) {
  return {.name = name, .types = {rgb}, .textured = true, .doc = doc, .minimum = 0, .maximum = 1};
}

}  // namespace

void add_textures(std::vector<PluginRule>& table) {
  const PropertyRule to_uv = {
      .name = "to_uv",
      .types = {transform},
      .doc =
          "applied to (u, v, 0, 1) before the lookup; a matrix of 9 values is a 2D one "
          "(default identity)"};
  table.push_back(
      {.category = "texture",
       .name = "bitmap",
       .properties =
           {file("image; integers (8 and 16 bit) are sRGB"),
            to_uv,
            {.name = "filter_type",
             .types = {string},
             .values = {"bilinear", "nearest"},
             .doc = "interpolation (default bilinear); 0.6's ewa and trilinear are read as bilinear"},
            {.name = "wrap_mode",
             .types = {string},
             .values = {"repeat", "mirror", "clamp", "zero", "one"},
             .doc = "outside [0, 1] (default repeat); zero and one, constant values, are 0.6's"},
            {.name = "wrap_mode_u",
             .types = {string},
             .values = {"repeat", "mirror", "clamp", "zero", "one"},
             .doc = "0.6: along u alone (default wrap_mode)"},
            {.name = "wrap_mode_v",
             .types = {string},
             .values = {"repeat", "mirror", "clamp", "zero", "one"},
             .doc = "0.6: along v alone (default wrap_mode)"},
            flag("raw", "the values are numbers, not sRGB (default false)"),
            {.name = "channel",
             .types = {string},
             .values = {"r", "g", "b", "a", "number"},
             .doc = "0.6: only this channel, decoded as colors are; `number` is Candela's addition, a float "
                    "texture of pbrt: the alpha of an image that is not opaque, else the mean of the colors"},
            {.name = "gamma",
             .types = {number},
             .doc = "0.6: power of the values; 1 linear, -1 sRGB, 0 as the file says (default)",
             .minimum = -1},
            ignored("format", {string}, "storage only"),
            ignored("accel", {boolean}, "for GPUs only"),
            ignored("max_anisotropy", {number}, "0.6: textures are not prefiltered"),
            ignored("cache", {boolean}, "0.6: no cache files are written")},
       .child_categories = {},
       .doc = "an image"});
  table.push_back(
      {.category = "texture",
       .name = "checkerboard",
       .properties = {textured_color("color0", "color of the squares at the origin (default 0.4)"),
                      textured_color("color1", "color of the other squares (default 0.2)"), to_uv},
       .child_categories = {},
       .doc = "two squares by two in [0, 1]^2"});
  table.push_back(
      {.category = "texture",
       .name = "mix",
       .properties = {textured(non_negative_rgb("color0", "color at an amount of 0 (default 0)")),
                      textured(non_negative_rgb("color1", "color at an amount of 1 (default 1)")),
                      textured({.name = "amount",
                                .types = {number},
                                .doc = "weight of color1; color0 has the rest (default 0.5)",
                                .minimum = 0}),
                      {.name = "maximum",
                       .types = {number},
                       .doc = "upper bound of values (default none)",
                       .minimum = 0},
                      flag("root", "takes the square root of the result (default false)")},
       .child_categories = {},
       .doc =
           "Candela's addition: two textures mixed by an amount, also a texture; values below 0 become 0"});
  table.push_back(
      {.category = "texture",
       .name = "gridtexture",
       .properties =
           {textured_color("color0", "color between the lines (default 0.2)"),
            textured_color("color1", "color of the lines (default 0.4)"),
            {.name = "line_width",
             .types = {number},
             .doc = "width from the middle of a line to its edge, in (u, v) after to_uv (default 0.01)",
             .minimum = 0},
            to_uv},
       .child_categories = {},
       .doc = "0.6: lines where u or v is an integer"});
  table.push_back(
      {.category = "texture",
       .name = "wireframe",
       .properties = {textured_color("interior_color", "color within triangles (default 0.5)"),
                      textured_color("edge_color", "color of their edges (default 0.1)"),
                      {.name = "line_width",
                       .types = {number},
                       .doc = "width from an edge to the interior, in units of the mesh in the scene or its "
                              "shapegroup (default 0: a tenth of the mean edge of each mesh)",
                       .minimum = 0},
                      {.name = "step_width",
                       .types = {number},
                       .doc = "the part of line_width over which the colors mix (default 0.5)",
                       .minimum = 0,
                       .maximum = 1}},
       .child_categories = {},
       .doc = "0.6: the edges of the triangles of a mesh; other surfaces are interior"});
  table.push_back(
      {.category = "texture",
       .name = "mesh_attribute",
       .properties =
           {{.name = "name",
             .types = {string},
             .required = true,
             .doc =
                 "begins with vertex_ or face_, as in vertex_color; the mesh must have it (docs/meshes.md)"},
            {.name = "scale", .types = {number}, .doc = "a factor (default 1)"}},
       .child_categories = {},
       .doc = "an attribute of the vertices of a mesh, linear over each triangle, or of its faces; 0.6's "
              "`vertexcolors` is vertex_color"});
  table.push_back({.category = "texture",
                   .name = "volume",
                   .properties = {{.name = "volume",
                                   .types = {rgb},
                                   .doc = "a <volume> of this name, or a color (default 0.75)",
                                   .minimum = 0}},
                   .child_categories = {"volume"},
                   .doc = "a volume at the place in the world; as a bump map it is flat"});
  table.push_back({.category = "texture",
                   .name = "rawconstant",
                   .properties = {{.name = "value",
                                   .types = {number, rgb, vector},
                                   .required = true,
                                   .doc = "a number, or three of them as linear Rec.709; not negative"}},
                   .child_categories = {},
                   .doc = "the same value everywhere"});
  table.push_back({.category = "texture",
                   .name = "scale",
                   .properties = {non_negative_rgb("scale", "the factor (default 1)")},
                   .child_categories = {"texture"},
                   .doc = "0.6: the one texture it holds, under any name, times a constant"});
}

}  // namespace candela::description::rules
