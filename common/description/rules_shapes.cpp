// Shapes, from Mitsuba's documentation: what is here is what Candela renders.
#include "common/description/rules.h"

namespace candela::description::rules {

namespace {

void add_curves(std::vector<PluginRule>& table) {
  const auto curve = [](std::string_view name, std::string_view doc, std::string_view differs) {
    return PluginRule{
        .category = "shape",
        .name = name,
        .properties = {file("text, a control point a line: x y z radius; an empty line between curves"),
                       to_world("object to world (default identity)"),
                       flag("flip_normals", "normals point the other way (default false)"), silhouette()},
        .child_categories = {"bsdf", "emitter", "medium"},
        .doc = doc,
        .differs = differs};
  };
  table.push_back(curve("bsplinecurve",
                        "tubes along uniform cubic B-splines, without caps; u goes around, v along a curve",
                        "tubes are meshes of 16 sides with smooth normals (fewer beyond 125 000 rings)"));
  table.push_back(
      curve("linearcurve", "tubes along straight segments, without caps; u goes around, v along a curve",
            "tubes are meshes of 16 sides with smooth normals (fewer beyond 125 000 rings), mitered where "
            "segments meet, where Mitsuba has balls"));
}

void add_heightfield(std::vector<PluginRule>& table) {
  const auto samples = [](std::string_view name, std::string_view doc) {
    return PropertyRule{.name = name, .types = {integer}, .doc = doc, .minimum = 2, .maximum = 131072};
  };
  PropertyRule heights =
      file("an image of heights, a vertex per pixel; the first row is at y = -1; heights may be negative");
  heights.required = false;
  table.push_back(
      {.category = "shape",
       .name = "heightfield",
       .properties =
           {heights,
            {.name = "texture",
             .types = {},
             .textured = true,
             .any_slot = true,
             .doc = "heights in place of filename, under any name or none; a bitmap has a vertex per pixel"},
            samples("width", "vertices along x of a texture that is no bitmap (default 32)"),
            samples("height", "vertices along y of a texture that is no bitmap (default 32)"),
            {.name = "scale", .types = {number}, .doc = "factor of the heights (default 1)"},
            flag("shading_normals", "normals are smooth over the grid (default true)"),
            to_world("object to world (default identity)"),
            flag("flip_normals", "normals point the other way (default false)"),
            silhouette()},
       .child_categories = {"bsdf", "emitter", "medium"},
       .doc = "a grid of heights along z over [-1, 1]^2, facing +z; (u, v) = (x + 1, y + 1) / 2; at most "
              "16785409 (4097 x 4097) vertices, of some 500 bytes each; 0.6's shape",
       .differs = "a cell of the grid is two triangles; Mitsuba 0.6 resamples the heights to 2^n + 1 a side "
                  "and has bilinear patches"});
}

}  // namespace

void add_shapes(std::vector<PluginRule>& table) {
  const std::vector<std::string_view> children = {"bsdf", "emitter", "medium"};
  const PropertyRule place = to_world("object to world (default identity)");
  const PropertyRule flip = flag("flip_normals", "normals point the other way (default false)");
  const PropertyRule faceted =
      flag("face_normals", "normals of the file are dropped, triangles look flat (default false)");
  const PropertyRule creases = {.name = "max_smooth_angle",
                                .types = {number},
                                .doc =
                                    "degrees: faces that meet at more than this have a crease, others are "
                                    "smooth; normals of the file are dropped (default: as the file)",
                                .minimum = 0,
                                .maximum = 180};
  table.push_back(
      {.category = "shape",
       .name = "obj",
       .properties = {file("Wavefront OBJ with triangles and polygons"),
                      place,
                      faceted,
                      creases,
                      flip,
                      flag("flip_tex_coords", "v becomes 1 - v (default true)"),
                      flag("collapse",
                           "the file is one mesh with one bsdf; else a part begins at each `g` and `usemtl`, "
                           "with smooth normals and the bsdf named as its material (default true; before "
                           "version 2 or with load_materials false)"),
                      flag("load_materials",
                           "materials without a bsdf of their name are those of the file's `mtllib`, as in "
                           "Mitsuba 0.6 (default false; before version 2 true)"),
                      {.name = "shape_index",
                       .types = {integer},
                       .doc = "0.6: only this part, from 0; a part begins at each `o`, too (default -1: all)",
                       .minimum = -1,
                       .maximum = 4294967295.0},
                      silhouette()},
       .child_categories = children,
       .doc = "triangle mesh of a Wavefront OBJ file"});
  table.push_back(
      {.category = "shape",
       .name = "ply",
       .properties =
           {file("Stanford PLY, text or binary, with triangles and polygons"), place, faceted, creases, flip,
            flag("flip_tex_coords", "v becomes 1 - v (default false)"), silhouette(),
            flag("srgb",
                 "attributes are sRGB (default: those stored as integers are; before version 2, all)")},
       .child_categories = children,
       .doc = "triangle mesh of a PLY file"});
  table.push_back({.category = "shape",
                   .name = "serialized",
                   .properties = {file("Mitsuba's compressed mesh file, versions 3 and 4"),
                                  {.name = "shape_index",
                                   .types = {integer},
                                   .doc = "index of the mesh in the file, from 0 (default 0)",
                                   .minimum = 0,
                                   .maximum = 4294967295.0},
                                  place,
                                  faceted,
                                  creases,
                                  flip,
                                  silhouette()},
                   .child_categories = children,
                   .doc = "triangle mesh of Mitsuba's own format"});
  table.push_back({.category = "shape",
                   .name = "pbrtmesh",
                   .properties = {file("a file of a pbrt scene"),
                                  {.name = "offset",
                                   .types = {integer},
                                   .required = true,
                                   .doc = "start of the Shape directive, in bytes",
                                   .minimum = 0},
                                  {.name = "curves",
                                   .types = {integer},
                                   .doc = "number of Shape directives of curves in a row (default: no curve)",
                                   .minimum = 1},
                                  place,
                                  faceted,
                                  flip,
                                  silhouette()},
                   .child_categories = children,
                   .doc = "Candela's addition: triangles of one Shape directive of a pbrt scene, or tubes "
                          "along its curves"});
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
  table.push_back(
      {.category = "shape",
       .name = "sphere",
       .properties = {{.name = "center",
                       .types = {point},
                       .doc = "in object space, before to_world (default 0, 0, 0)"},
                      positive("radius", "in object space, before to_world (default 1)"),
                      place,
                      flip,
                      silhouette()},
       .child_categories = children,
       .doc = "a sphere, or an ellipsoid if to_world scales it unevenly; an emitter must be a sphere"});
  table.push_back({.category = "shape",
                   .name = "disk",
                   .properties = {place, flip, silhouette()},
                   .child_categories = children,
                   .doc = "the unit disk in the plane z = 0, facing +z, or an ellipse if to_world scales it "
                          "unevenly; an emitter must be a disk"});
  table.push_back({.category = "shape",
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
                   .doc = "a cylinder without caps, facing outside, or one over an ellipse if to_world "
                          "scales it unevenly; an emitter must be round"});
  add_curves(table);
  table.push_back(
      {.category = "shape",
       .name = "sdfgrid",
       .properties =
           {file("Mitsuba's .vol file of one channel: distances at the corners of cells in [0, 1]^3, "
                 "negative inside"),
            place, flip,
            ignored("normals", {string}, "they are smooth: differences of the field over a cell"),
            ignored("watertight", {boolean}, "the mesh has holes only at the grid's border"), silhouette()},
       .child_categories = children,
       .doc = "the surface on which a grid of signed distances is zero",
       .differs = "the surface is a mesh of triangles, finer than the grid; Mitsuba intersects the field "
                  "itself; no texture coordinates"});
  add_heightfield(table);
  table.push_back({.category = "shape",
                   .name = "shapegroup",
                   .properties = {},
                   .child_categories = {"shape"},
                   .doc = "shapes, with their bsdfs, for instances; none may be an emitter"});
  table.push_back(
      {.category = "shape",
       .name = "instance",
       .properties = {to_world("group to world, uneven scales and mirrors too (default identity)")},
       .child_categories = {"shape"},
       .doc = "a copy of a shapegroup, by its id; it takes almost no memory"});
}

}  // namespace candela::description::rules
