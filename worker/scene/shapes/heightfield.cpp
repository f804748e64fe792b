#include "worker/scene/shapes/heightfield.h"

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "common/base/work_monitor.h"
#include "worker/loaders/mesh.h"
#include "worker/loaders/parallel.h"
#include "worker/scene/textures/bitmap.h"
#include "worker/scene/textures/height_image.h"

namespace candela::scene {
namespace {

// A vertex takes 56 bytes of mesh and some 450 while the tree is built: 8 GiB in all. Mitsuba 0.6's grids are
// 2^n + 1 vertices a side.
constexpr std::uint64_t kMaxVertices = std::uint64_t{4097} * 4097;

struct Grid {
  std::uint32_t width = 0, height = 0;
  std::vector<float> z;  // row by row

  std::size_t size() const { return std::size_t{width} * height; }
};

Error error_at(const description::Object& object, const char* property, std::string message) {
  const description::Property* const given = object.find(property);
  const description::Location& where = given != nullptr ? given->where : object.where;
  return input_error(std::move(message)).at(where.file, where.line).with_field(property);
}

Result<Grid> grid_of_file(const description::Object& object, const std::string& file, double scale,
                          const description::FileSource& files, TextureStore& textures) {
  const auto bytes = files.open(file);
  if (!bytes.ok()) return error_at(object, "filename", bytes.error().message);
  const auto image = decode_heights(bytes->view, file, kMaxVertices, textures.scratch());
  if (!image.ok())
    return error_at(object, "filename", "'" + file + "': " + image.error().message)
        .with_mend(image.error().mend);
  Grid grid{image->width, image->height, {}};
  grid.z.reserve(grid.size());
  for (std::uint32_t y = 0; y < grid.height; ++y)
    for (std::uint32_t x = 0; x < grid.width; ++x)
      grid.z.push_back(static_cast<float>(scale * static_cast<double>(luminance(image->at(x, y)))));
  return grid;
}

Result<Grid> grid_of_texture(const description::Object& object, const description::ObjectPtr& child,
                             double scale, TextureStore& textures) {
  CANDELA_ASSIGN(const FloatTexture texture, textures.nested_number(child));
  Grid grid;
  if (const auto size = size_of(texture.texture)) {
    grid.width = (*size)[0];
    grid.height = (*size)[1];
  } else {
    grid.width = static_cast<std::uint32_t>(object.get_integer("width", 32));
    grid.height = static_cast<std::uint32_t>(object.get_integer("height", 32));
  }
  if (grid.width < 2 || grid.height < 2 || grid.size() > kMaxVertices) {
    return error_at(object, "width",
                    "the height field has " + std::to_string(grid.width) + " x " +
                        std::to_string(grid.height) + " vertices; it has 2 x 2 at least and " +
                        std::to_string(kMaxVertices) + " in all at most");
  }
  grid.z.reserve(grid.size());
  SurfacePoint at;
  for (std::uint32_t y = 0; y < grid.height; ++y) {
    work_step();
    at.uv.y = static_cast<float>((y + 0.5) / grid.height);
    for (std::uint32_t x = 0; x < grid.width; ++x) {
      at.uv.x = static_cast<float>((x + 0.5) / grid.width);
      grid.z.push_back(static_cast<float>(scale * static_cast<double>(texture.eval(at))));
    }
  }
  return grid;
}

loaders::Mesh mesh_of(const Grid& grid) {
  loaders::Mesh mesh;
  mesh.positions.resize(grid.size());
  mesh.uvs.resize(grid.size());
  const std::uint32_t across = grid.width - 1, down = grid.height - 1;
  loaders::for_ranges(grid.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const double u = static_cast<double>(i % grid.width) / across;
      const double v = static_cast<double>(i / grid.width) / down;
      mesh.positions[i] = {static_cast<float>(2 * u - 1), static_cast<float>(2 * v - 1), grid.z[i]};
      mesh.uvs[i] = {static_cast<float>(u), static_cast<float>(v)};
    }
  });
  const std::size_t cells = std::size_t{across} * down;
  mesh.triangles.resize(2 * cells);
  loaders::for_ranges(cells, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto a = static_cast<std::uint32_t>(i / across * grid.width + i % across);
      const std::uint32_t b = a + 1, c = a + grid.width, d = c + 1;
      mesh.triangles[2 * i] = {a, b, d};
      mesh.triangles[2 * i + 1] = {a, d, c};
    }
  });
  return mesh;
}

// The sum of the unit normals that the cells around a vertex have there, as bilinear patches over cells of
// size 1; in object space, of any length.
Vec3d normal_at(const Grid& grid, std::size_t i) {
  const auto x = static_cast<std::uint32_t>(i % grid.width), y = static_cast<std::uint32_t>(i / grid.width);
  const auto z = [&](std::size_t k) { return static_cast<double>(grid.z[k]); };
  Vec3d sum;
  for (const bool below : {false, true}) {
    if (below ? y + 1 == grid.height : y == 0) continue;
    const double dy = below ? z(i + grid.width) - z(i) : z(i) - z(i - grid.width);
    for (const bool right : {false, true}) {
      if (right ? x + 1 == grid.width : x == 0) continue;
      const double dx = right ? z(i + 1) - z(i) : z(i) - z(i - 1);
      sum += normalize(Vec3d{-dx, -dy, 1});
    }
  }
  return {sum.x * (grid.width - 1) / 2, sum.y * (grid.height - 1) / 2, sum.z};
}

}  // namespace

Result<Shape> build_heightfield(const description::Object& object, const description::FileSource& files,
                                TextureStore& textures) {
  const double scale = object.get_number("scale", 1);
  const std::string file = object.get_string("filename", "");
  Grid grid;
  if (!file.empty()) {
    CANDELA_ASSIGN(grid, grid_of_file(object, file, scale, files, textures));
  } else {
    const auto children = object.children_of("texture");
    if (children.size() != 1)
      return error_at(object, "filename", "the height field has neither a file nor one texture");
    CANDELA_ASSIGN(grid, grid_of_texture(object, children[0], scale, textures));
  }
  constexpr std::uint64_t kVertexBytes = 80;  // of a vertex and two triangles, while the shape is made
  description::Charge charge(files.budget());
  CANDELA_TRY(charge.add(grid.size() * kVertexBytes, object.where, "the height field"));
  const Transform to_world(object.get_transform("to_world"));
  const bool flip = object.get_bool("flip_normals", false);
  auto made = shape_from_mesh(mesh_of(grid), to_world, true, flip, object.where.file);
  if (!made.ok()) return error_at(object, "scale", made.error().message);
  Shape shape = std::move(made).value();
  if (!object.get_bool("shading_normals", true)) return shape;
  // Normals are set here, for those of a steep grid may be over 90 degrees from a triangle's own: they must
  // not turn it over.
  shape.normals.resize(shape.positions.size());
  loaders::for_ranges(shape.normals.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3d n = to_world.normal(normal_at(grid, i));
      const double l = length(n);
      const double sign = flip ? -1 : 1;
      shape.normals[i] = l > 0 && std::isfinite(l) ? Vec3(n * (sign / l)) : Vec3{};
    }
  });
  return shape;
}

}  // namespace candela::scene
