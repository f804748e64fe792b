// Textures, from Mitsuba's documentation: what is here is what Candela renders.
#include "common/description/rules.h"

namespace candela::description::rules {

void add_textures(std::vector<PluginRule>& table) {
  Plugins textures(table, "texture");
  const PropertyRule to_uv =
      value("to_uv", {transform},
            "applied to (u, v, 0, 1) before the lookup; a matrix of 9 values is a 2D one "
            "(default identity)");
  textures.add(
      "bitmap", "an image",
      {file("image; integers (8 and 16 bit) are sRGB"), to_uv,
       choice("filter_type", {"bilinear", "nearest"},
              "interpolation (default bilinear); 0.6's ewa and trilinear are read as bilinear"),
       choice("wrap_mode", {"repeat", "mirror", "clamp", "zero", "one"},
              "outside [0, 1] (default repeat); zero and one, constant values, are 0.6's"),
       choice("wrap_mode_u", {"repeat", "mirror", "clamp", "zero", "one"},
              "0.6: along u alone (default wrap_mode)"),
       choice("wrap_mode_v", {"repeat", "mirror", "clamp", "zero", "one"},
              "0.6: along v alone (default wrap_mode)"),
       flag("raw", "the values are numbers, not sRGB (default false)"),
       choice("channel", {"r", "g", "b", "a", "number"},
              "0.6: only this channel, decoded as colors are; `number` is Candela's addition, a float "
              "texture of pbrt: the alpha of an image that is not opaque, else the mean of the colors"),
       value("gamma", {number}, "0.6: power of the values; 1 linear, -1 sRGB, 0 as the file says (default)",
             -1),
       ignored("format", {string}, "storage only"), ignored("accel", {boolean}, "for GPUs only"),
       ignored("max_anisotropy", {number}, "0.6: textures are not prefiltered"),
       ignored("cache", {boolean}, "0.6: no cache files are written")});
  textures.add("checkerboard", "two squares by two in [0, 1]^2",
               {reflectance("color0", "color of the squares at the origin (default 0.4)"),
                reflectance("color1", "color of the other squares (default 0.2)"), to_uv});
  textures.add("mix",
               "Candela's addition: two textures mixed by an amount, also a texture; values below 0 become 0",
               {textured(non_negative_rgb("color0", "color at an amount of 0 (default 0)")),
                textured(non_negative_rgb("color1", "color at an amount of 1 (default 1)")),
                textured(value("amount", {number}, "weight of color1; color0 has the rest (default 0.5)", 0)),
                value("maximum", {number}, "upper bound of values (default none)", 0),
                flag("root", "takes the square root of the result (default false)")});
  textures.add("gridtexture", "0.6: lines where u or v is an integer",
               {reflectance("color0", "color between the lines (default 0.2)"),
                reflectance("color1", "color of the lines (default 0.4)"),
                value("line_width", {number},
                      "width from the middle of a line to its edge, in (u, v) after to_uv (default 0.01)", 0),
                to_uv});
  textures.add("wireframe", "0.6: the edges of the triangles of a mesh; other surfaces are interior",
               {reflectance("interior_color", "color within triangles (default 0.5)"),
                reflectance("edge_color", "color of their edges (default 0.1)"),
                value("line_width", {number},
                      "width from an edge to the interior, in units of the mesh in the scene or its "
                      "shapegroup (default 0: a tenth of the mean edge of each mesh)",
                      0),
                value("step_width", {number},
                      "the part of line_width over which the colors mix (default 0.5)", 0, 1)});
  textures.add(
      "mesh_attribute",
      "an attribute of the vertices of a mesh, linear over each triangle, or of its faces; 0.6's "
      "`vertexcolors` is vertex_color",
      {required(
           value("name", {string},
                 "begins with vertex_ or face_, as in vertex_color; the mesh must have it (docs/meshes.md)")),
       value("scale", {number}, "a factor (default 1)")});
  textures.add("volume", "a volume at the place in the world; as a bump map it is flat",
               {non_negative_rgb("volume", "a <volume> of this name, or a color (default 0.75)")},
               {"volume"});
  textures.add("rawconstant", "the same value everywhere",
               {required(value("value", {number, rgb, vector},
                               "a number, or three of them as linear Rec.709; not negative"))});
  textures.add("scale", "0.6: the one texture it holds, under any name, times a constant",
               {non_negative_rgb("scale", "the factor (default 1)")}, {"texture"});
}

}  // namespace candela::description::rules
