// Shapes, from Mitsuba's documentation: what is here is what Candela renders.
#include "common/description/rules.h"

namespace candela::description::rules {

namespace {

void add_curve(Plugins& shapes, std::string_view name, std::string_view doc, std::string_view differs) {
  shapes.add(name, doc,
             {file("text, a control point a line: x y z radius; an empty line between curves"),
              to_world("object to world (default identity)"),
              flag("flip_normals", "normals point the other way (default false)"), silhouette()},
             {"bsdf", "emitter", "medium"}, differs);
}

void add_heightfield(Plugins& shapes) {
  const auto samples = [](std::string_view name, std::string_view doc) {
    return value(name, {integer}, doc, 2, 131072);
  };
  PropertyRule heights =
      file("an image of heights, a vertex per pixel; the first row is at y = -1; heights may be negative");
  heights.required = false;
  shapes.add(
      "heightfield",
      "a grid of heights along z over [-1, 1]^2, facing +z; (u, v) = (x + 1, y + 1) / 2; at most "
      "16785409 (4097 x 4097) vertices, of some 500 bytes each; 0.6's shape",
      {heights,
       {.name = "texture",
        .types = {},
        .textured = true,
        .any_slot = true,
        .doc = "heights in place of filename, under any name or none; a bitmap has a vertex per pixel"},
       samples("width", "vertices along x of a texture that is no bitmap (default 32)"),
       samples("height", "vertices along y of a texture that is no bitmap (default 32)"),
       value("scale", {number}, "factor of the heights (default 1)"),
       flag("shading_normals", "normals are smooth over the grid (default true)"),
       to_world("object to world (default identity)"),
       flag("flip_normals", "normals point the other way (default false)"),
       silhouette()},
      {"bsdf", "emitter", "medium"},
      "a cell of the grid is two triangles; Mitsuba 0.6 resamples the heights to 2^n + 1 a side "
      "and has bilinear patches");
}

}  // namespace

void add_shapes(std::vector<PluginRule>& table) {
  const std::vector<std::string_view> children = {"bsdf", "emitter", "medium"};
  Plugins shapes(table, "shape", children);
  const PropertyRule place = to_world("object to world (default identity)");
  const PropertyRule flip = flag("flip_normals", "normals point the other way (default false)");
  const PropertyRule faceted =
      flag("face_normals", "normals of the file are dropped, triangles look flat (default false)");
  const PropertyRule creases = value("max_smooth_angle", {number},
                                     "degrees: faces that meet at more than this have a crease, others are "
                                     "smooth; normals of the file are dropped (default: as the file)",
                                     0, 180);
  shapes.add("obj", "triangle mesh of a Wavefront OBJ file",
             {file("Wavefront OBJ with triangles and polygons"), place, faceted, creases, flip,
              flag("flip_tex_coords", "v becomes 1 - v (default true)"),
              flag("collapse",
                   "the file is one mesh with one bsdf; else a part begins at each `g` and `usemtl`, "
                   "with smooth normals and the bsdf named as its material (default true; before "
                   "version 2 or with load_materials false)"),
              flag("load_materials",
                   "materials without a bsdf of their name are those of the file's `mtllib`, as in "
                   "Mitsuba 0.6 (default false; before version 2 true)"),
              value("shape_index", {integer},
                    "0.6: only this part, from 0; a part begins at each `o`, too (default -1: all)", -1,
                    4294967295.0),
              silhouette()});
  shapes.add(
      "ply", "triangle mesh of a PLY file",
      {file("Stanford PLY, text or binary, with triangles and polygons"), place, faceted, creases, flip,
       flag("flip_tex_coords", "v becomes 1 - v (default false)"), silhouette(),
       flag("srgb", "attributes are sRGB (default: those stored as integers are; before version 2, all)")});
  shapes.add(
      "serialized", "triangle mesh of Mitsuba's own format",
      {file("Mitsuba's compressed mesh file, versions 3 and 4"),
       value("shape_index", {integer}, "index of the mesh in the file, from 0 (default 0)", 0, 4294967295.0),
       place, faceted, creases, flip, silhouette()});
  shapes.add(
      "pbrtmesh",
      "Candela's addition: triangles of one Shape directive of a pbrt scene, or tubes "
      "along its curves",
      {file("a file of a pbrt scene"),
       required(value("offset", {integer}, "start of the Shape directive, in bytes", 0)),
       value("curves", {integer}, "number of Shape directives of curves in a row (default: no curve)", 1),
       place, faceted, flip, silhouette()});
  shapes.add("rectangle", "[-1, 1] x [-1, 1] in the plane z = 0, facing +z", {place, flip, silhouette()});
  shapes.add("cube", "[-1, 1]^3, facing outside", {place, flip, silhouette()});
  shapes.add("sphere",
             "a sphere, or an ellipsoid if to_world scales it unevenly; an emitter must be a sphere",
             {value("center", {point}, "in object space, before to_world (default 0, 0, 0)"),
              positive("radius", "in object space, before to_world (default 1)"), place, flip, silhouette()});
  shapes.add("disk",
             "the unit disk in the plane z = 0, facing +z, or an ellipse if to_world scales it "
             "unevenly; an emitter must be a disk",
             {place, flip, silhouette()});
  shapes.add("cylinder",
             "a cylinder without caps, facing outside, or one over an ellipse if to_world "
             "scales it unevenly; an emitter must be round",
             {value("p0", {point}, "where the axis begins, in object space (default 0, 0, 0)"),
              value("p1", {point}, "where it ends (default 0, 0, 1)"),
              positive("radius", "in object space, before to_world (default 1)"), place, flip, silhouette()});
  add_curve(shapes, "bsplinecurve",
            "tubes along uniform cubic B-splines, without caps; u goes around, v along a curve",
            "tubes are meshes of 16 sides with smooth normals (fewer beyond 125 000 rings)");
  add_curve(shapes, "linearcurve",
            "tubes along straight segments, without caps; u goes around, v along a curve",
            "tubes are meshes of 16 sides with smooth normals (fewer beyond 125 000 rings), mitered where "
            "segments meet, where Mitsuba has balls");
  shapes.add(
      "sdfgrid", "the surface on which a grid of signed distances is zero",
      {file("Mitsuba's .vol file of one channel: distances at the corners of cells in [0, 1]^3, "
            "negative inside"),
       place, flip, ignored("normals", {string}, "they are smooth: differences of the field over a cell"),
       ignored("watertight", {boolean}, "the mesh has holes only at the grid's border"), silhouette()},
      children,
      "the surface is a mesh of triangles, finer than the grid; Mitsuba intersects the field "
      "itself; no texture coordinates");
  add_heightfield(shapes);
  shapes.add("shapegroup", "shapes, with their bsdfs, for instances; none may be an emitter", {}, {"shape"});
  shapes.add("instance", "a copy of a shapegroup, by its id; it takes almost no memory",
             {to_world("group to world, uneven scales and mirrors too (default identity)")}, {"shape"});
}

}  // namespace candela::description::rules
