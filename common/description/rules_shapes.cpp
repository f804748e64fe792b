// Shapes, from Mitsuba's documentation: what is here is what Candela renders.
#include "common/description/rules.h"

namespace candela::description::rules {

void add_shapes(std::vector<PluginRule>& table) {
  const std::vector<std::string_view> children = {"bsdf", "emitter", "medium"};
  const PropertyRule place = to_world("object to world (default identity)");
  const PropertyRule flip = flag("flip_normals", "normals point the other way (default false)");
  const PropertyRule faceted =
      flag("face_normals", "normals of the file are dropped, triangles look flat (default false)");
  table.push_back(
      {.category = "shape",
       .name = "obj",
       .properties = {file("Wavefront OBJ with triangles and polygons; materials are not read"), place,
                      faceted, flip, flag("flip_tex_coords", "v becomes 1 - v (default true)"), silhouette(),
                      ignored("collapse", {boolean}, "0.6: a file is one shape always")},
       .child_categories = children,
       .doc = "triangle mesh of a Wavefront OBJ file"});
  table.push_back(
      {.category = "shape",
       .name = "ply",
       .properties = {file("Stanford PLY, text or binary, with triangles and polygons; colours are not read"),
                      place, faceted, flip, flag("flip_tex_coords", "v becomes 1 - v (default false)"),
                      silhouette(), ignored("srgb", {boolean}, "0.6: about colours, which are not read")},
       .child_categories = children,
       .doc = "triangle mesh of a PLY file"});
  table.push_back({.category = "shape",
                   .name = "serialized",
                   .properties = {file("Mitsuba's compressed mesh file, versions 3 and 4"),
                                  {.name = "shape_index",
                                   .types = {integer},
                                   .doc = "which mesh of the file, from 0 (default 0)",
                                   .minimum = 0,
                                   .maximum = 4294967295.0},
                                  place,
                                  faceted,
                                  flip,
                                  silhouette()},
                   .child_categories = children,
                   .doc = "triangle mesh of Mitsuba's own format"});
  table.push_back({.category = "shape",
                   .name = "rectangle",
                   .properties = {place, flip, silhouette()},
                   .child_categories = children,
                   .doc = "[-1, 1] x [-1, 1] in the plane z = 0, facing +z"});
  table.push_back({.category = "shape",
                   .name = "cube",
                   .properties = {place, flip, silhouette()},
                   .child_categories = children,
                   .doc = "[-1, 1]^3, facing outside"});
  table.push_back({.category = "shape",
                   .name = "sphere",
                   .properties = {{.name = "center",
                                   .types = {point},
                                   .doc = "in object space, before to_world (default 0, 0, 0)"},
                                  positive("radius", "in object space, before to_world (default 1)"),
                                  place,
                                  flip,
                                  silhouette()},
                   .child_categories = children,
                   .doc = "a true sphere; to_world may not scale it unevenly"});
  table.push_back(
      {.category = "shape",
       .name = "disk",
       .properties = {place, flip, silhouette()},
       .child_categories = children,
       .doc = "the unit disk in the plane z = 0, facing +z; to_world may not make it an ellipse"});
  table.push_back(
      {.category = "shape",
       .name = "cylinder",
       .properties = {{.name = "p0",
                       .types = {point},
                       .doc = "where the axis begins, in object space (default 0, 0, 0)"},
                      {.name = "p1", .types = {point}, .doc = "where it ends (default 0, 0, 1)"},
                      positive("radius", "in object space, before to_world (default 1)"),
                      place,
                      flip,
                      silhouette()},
       .child_categories = children,
       .doc = "a true cylinder without caps, facing outside; to_world may not scale it unevenly around its "
              "axis"});
  table.push_back({.category = "shape",
                   .name = "shapegroup",
                   .properties = {},
                   .child_categories = {"shape"},
                   .doc =
                       "shapes, with their bsdfs, that are in the scene only where instances put them; none "
                       "may be an emitter"});
  table.push_back(
      {.category = "shape",
       .name = "instance",
       .properties = {to_world("group to world, uneven scales and mirrors too (default identity)")},
       .child_categories = {"shape"},
       .doc = "a shapegroup, referred to by its id, once more; it costs next to no memory"});
}

}  // namespace candela::description::rules
