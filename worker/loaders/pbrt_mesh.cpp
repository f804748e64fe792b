#include "worker/loaders/pbrt_mesh.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/description/check.h"
#include "common/description/pbrt/parameters.h"
#include "worker/core/math.h"
#include "worker/loaders/loop_subdivision.h"

namespace candela::loaders {
namespace {

using description::error_at;
using description::Location;
using description::pbrt::Parameter;
using description::pbrt::ParameterList;
using description::pbrt::Tokens;

constexpr std::uint64_t kMaxTriangles = std::uint64_t{1} << 28;
constexpr std::uint32_t kPatchGrid = 16;  // quads along each side of a patch that is not flat
constexpr std::uint32_t kAround = 256;    // quads around a whole circle
constexpr std::uint32_t kFromPoleToPole = 128;

// The numbers of a parameter as points or pairs; empty if it is absent.
template <class Vector, std::size_t n>
Result<std::vector<Vector>> vectors(ParameterList& parameters, std::string_view name,
                                    std::initializer_list<std::string_view> types, const Vec3d& origin = {}) {
  std::vector<Vector> result;
  const Parameter* parameter = parameters.take(name, types);
  if (parameter == nullptr) return result;
  const std::vector<double>& numbers = parameter->numbers;
  result.resize(numbers.size() / n);
  for (std::size_t i = 0; i < result.size(); ++i) {
    std::array<float, n> v{};
    for (std::size_t k = 0; k < n; ++k) {
      v[k] = static_cast<float>(numbers[n * i + k] - origin[static_cast<int>(k)]);
      if (!std::isfinite(v[k]))
        return error_at(parameter->where, "a number of parameter '" + std::string(name) + "' is too large");
    }
    if constexpr (n == 3)
      result[i] = {v[0], v[1], v[2]};
    else
      result[i] = {v[0], v[1]};
  }
  return result;
}

// Corners of faces. A mesh of one face needs none.
Result<std::vector<std::uint32_t>> indices(ParameterList& parameters, const Location& where,
                                           std::size_t vertices, std::size_t corners) {
  std::vector<std::uint32_t> result;
  const Parameter* parameter = parameters.take("indices", {"integer"});
  if (parameter == nullptr) {
    if (vertices != corners) return error_at(where, "the mesh has no indices");
    for (std::uint32_t i = 0; i < corners; ++i) result.push_back(i);
    return result;
  }
  if (parameter->numbers.size() % corners != 0 || parameter->numbers.empty())
    return error_at(parameter->where, "the number of indices is no multiple of " + std::to_string(corners));
  result.reserve(parameter->numbers.size());
  for (const double index : parameter->numbers) {
    if (!(index >= 0 && index < static_cast<double>(vertices)))
      return error_at(parameter->where,
                      "an index is outside of the mesh's " + std::to_string(vertices) + " vertices");
    result.push_back(static_cast<std::uint32_t>(index));
  }
  return result;
}

struct Vertices {
  std::vector<Vec3> positions, normals;
  std::vector<Vec2> uvs;
};

Result<Vertices> vertices(ParameterList& parameters, const Location& where, const Vec3d& origin) {
  Vertices v;
  CANDELA_ASSIGN(v.positions, (vectors<Vec3, 3>(parameters, "P", {"point3"}, origin)));
  if (v.positions.empty()) return error_at(where, "the mesh has no vertices: the parameter 'P' is missing");
  CANDELA_ASSIGN(v.normals, (vectors<Vec3, 3>(parameters, "N", {"normal", "normal3"})));
  CANDELA_ASSIGN(v.uvs, (vectors<Vec2, 2>(parameters, "uv", {"point2"})));
  if (v.uvs.empty()) {
    CANDELA_ASSIGN(v.uvs, (vectors<Vec2, 2>(parameters, "st", {"point2"})));
  }
  for (const std::size_t count : {v.normals.size(), v.uvs.size()})
    if (count != 0 && count != v.positions.size())
      return error_at(where, "the mesh has " + std::to_string(v.positions.size()) + " positions, but " +
                                 std::to_string(count) + " normals or texture coordinates");
  return v;
}

Result<Mesh> triangle_mesh(ParameterList& parameters, const Location& where, const Vec3d& origin) {
  CANDELA_ASSIGN(Vertices v, vertices(parameters, where, origin));
  CANDELA_ASSIGN(const std::vector<std::uint32_t> corners, indices(parameters, where, v.positions.size(), 3));
  Mesh mesh;
  mesh.positions = std::move(v.positions);
  mesh.normals = std::move(v.normals);
  mesh.uvs = std::move(v.uvs);
  for (std::size_t i = 0; i < corners.size(); i += 3)
    mesh.triangles.push_back({corners[i], corners[i + 1], corners[i + 2]});
  return mesh;
}

Result<Mesh> subdivision_mesh(ParameterList& parameters, const Location& where, const Vec3d& origin,
                              description::ReadingBudget& budget) {
  CANDELA_ASSIGN(Mesh mesh, triangle_mesh(parameters, where, origin));
  CANDELA_ASSIGN(const std::int64_t levels, parameters.integer("levels", 3));
  if (levels < 0 || levels > 10 || mesh.triangles.size() > (kMaxTriangles >> (2 * levels)))
    return error_at(where, "a subdivision of " + std::to_string(levels) + " levels has too many triangles");
  constexpr std::uint64_t kTriangleBytes = 120;  // with its vertices and edges, while the last level is made
  description::Charge charge(budget);
  CANDELA_TRY(charge.add((mesh.triangles.size() << (2 * levels)) * kTriangleBytes, where, "the subdivision"));
  return loop_subdivision(std::move(mesh), static_cast<int>(levels));
}

// ---- grids ----

struct GridPoint {
  Vec3d position, normal;
  Vec2 uv;
};

// A grid of quads over [0, 1]^2.
template <class Point>
void add_grid(Mesh& mesh, std::uint32_t across, std::uint32_t along, const Point& point) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  for (std::uint32_t j = 0; j <= along; ++j)
    for (std::uint32_t i = 0; i <= across; ++i) {
      const GridPoint p = point(static_cast<double>(i) / across, static_cast<double>(j) / along);
      mesh.positions.push_back(Vec3(p.position));
      mesh.normals.push_back(Vec3(p.normal));
      mesh.uvs.push_back(p.uv);
    }
  for (std::uint32_t j = 0; j < along; ++j)
    for (std::uint32_t i = 0; i < across; ++i) {
      const std::uint32_t a = first + j * (across + 1) + i, b = a + across + 1;
      mesh.triangles.push_back({a, a + 1, b + 1});
      mesh.triangles.push_back({a, b + 1, b});
    }
}

template <class T>
T bilinear(const std::array<T, 4>& corners, double u, double v) {
  return (corners[0] * (1 - u) + corners[1] * u) * (1 - v) + (corners[2] * (1 - u) + corners[3] * u) * v;
}

// A patch of corners (0,0), (1,0), (0,1), (1,1).
void add_patch(Mesh& mesh, const Vertices& v, const std::uint32_t* corner) {
  std::array<Vec3d, 4> p, n;
  std::array<double, 4> u = {0, 1, 0, 1}, w = {0, 0, 1, 1};  // texture coordinates
  for (std::size_t k = 0; k < 4; ++k) {
    p[k] = Vec3d(v.positions[corner[k]]);
    if (!v.normals.empty()) n[k] = Vec3d(v.normals[corner[k]]);
    if (v.uvs.empty()) continue;
    u[k] = static_cast<double>(v.uvs[corner[k]].x);
    w[k] = static_cast<double>(v.uvs[corner[k]].y);
  }
  const Vec3d du = p[1] - p[0], dv = p[2] - p[0], across = p[3] - p[0], normal = cross(du, dv);
  const double size = std::max({length(du), length(dv), length(across)});
  const bool flat = std::abs(dot(normal, across)) <= 1e-5 * length(normal) * size;
  const std::uint32_t grid = flat ? 1 : kPatchGrid;
  add_grid(mesh, grid, grid, [&](double s, double t) {
    const Vec3d along_u = (p[1] - p[0]) * (1 - t) + (p[3] - p[2]) * t;
    const Vec3d along_v = (p[2] - p[0]) * (1 - s) + (p[3] - p[1]) * s;
    return GridPoint{bilinear(p, s, t),
                     v.normals.empty() ? cross(along_u, along_v) : bilinear(n, s, t),
                     {static_cast<float>(bilinear(u, s, t)), static_cast<float>(bilinear(w, s, t))}};
  });
}

Result<Mesh> bilinear_mesh(ParameterList& parameters, const Location& where, const Vec3d& origin,
                           description::ReadingBudget& budget) {
  CANDELA_ASSIGN(const Vertices v, vertices(parameters, where, origin));
  CANDELA_ASSIGN(const std::vector<std::uint32_t> corners, indices(parameters, where, v.positions.size(), 4));
  if (corners.size() > kMaxTriangles / (2 * kPatchGrid * kPatchGrid))
    return error_at(where, "the mesh has too many patches");
  constexpr std::uint64_t kPatchBytes = (kPatchGrid + 1) * (kPatchGrid + 1) * sizeof(GridPoint) +
                                        2 * kPatchGrid * kPatchGrid * 3 * sizeof(std::uint32_t);
  description::Charge charge(budget);
  CANDELA_TRY(charge.add(corners.size() / 4 * kPatchBytes, where, "the patches"));
  Mesh mesh;
  for (std::size_t i = 0; i < corners.size(); i += 4) add_patch(mesh, v, &corners[i]);
  return mesh;
}

// ---- spheres, disks, cylinders ----

struct Circle {
  double cos = 1, sin = 0;
};
Circle on_circle(double radians) {
  Circle point;
  math::sincos(radians, point.sin, point.cos);
  return point;
}

struct Quadric {
  double radius = 1, z_min = -1, z_max = 1, phi_max = 0, inner = 0, height = 0;
  std::uint32_t around = kAround;
};

Result<Quadric> quadric(ParameterList& parameters, const Location& where, bool sphere) {
  Quadric q;
  CANDELA_ASSIGN(q.radius, parameters.number("radius", 1));
  CANDELA_ASSIGN(double z0, parameters.number("zmin", sphere ? -q.radius : -1));
  CANDELA_ASSIGN(double z1, parameters.number("zmax", sphere ? q.radius : 1));
  CANDELA_ASSIGN(const double degrees, parameters.number("phimax", 360));
  CANDELA_ASSIGN(q.inner, parameters.number("innerradius", 0));
  CANDELA_ASSIGN(q.height, parameters.number("height", 0));
  q.z_min = std::min(z0, z1);
  q.z_max = std::max(z0, z1);
  if (sphere) {
    q.z_min = std::max(q.z_min, -q.radius);
    q.z_max = std::min(q.z_max, q.radius);
  }
  q.phi_max = std::clamp(degrees, 0.0, 360.0) * (std::numbers::pi / 180);
  q.around =
      std::max(1U, static_cast<std::uint32_t>(std::ceil(kAround * q.phi_max / (2 * std::numbers::pi))));
  if (!(q.radius > 0) || !(q.phi_max > 0) || !(q.z_min < q.z_max) || !(q.inner >= 0 && q.inner < q.radius))
    return error_at(where, "the shape's parameters leave nothing of it");
  return q;
}

Vec2 to_uv(double u, double v) {
  return {static_cast<float>(u), static_cast<float>(v)};
}

// The angle from the z axis of the height z on the sphere.
double polar_angle(double z, double radius) {
  const double c = std::clamp(z / radius, -1.0, 1.0);
  return math::atan2(std::sqrt((1 - c) * (1 + c)), c);
}

Mesh sphere(const Quadric& q) {
  const double bottom = polar_angle(q.z_min, q.radius), top = polar_angle(q.z_max, q.radius);
  const auto along = std::max(
      1U, static_cast<std::uint32_t>(std::ceil(kFromPoleToPole * (bottom - top) / std::numbers::pi)));
  Mesh mesh;
  add_grid(mesh, q.around, along, [&](double u, double v) {
    const Circle phi = on_circle(u * q.phi_max), theta = on_circle(bottom + v * (top - bottom));
    const Vec3d n = {theta.sin * phi.cos, theta.sin * phi.sin, theta.cos};
    return GridPoint{n * q.radius, n, to_uv(u, v)};
  });
  return mesh;
}

Mesh disk(const Quadric& q) {
  Mesh mesh;
  add_grid(mesh, q.around, 1, [&](double u, double v) {
    const Circle phi = on_circle(u * q.phi_max);
    const double r = q.radius + v * (q.inner - q.radius);
    return GridPoint{{r * phi.cos, r * phi.sin, q.height}, {0, 0, 1}, to_uv(u, v)};
  });
  return mesh;
}

Mesh cylinder(const Quadric& q) {
  Mesh mesh;
  add_grid(mesh, q.around, 1, [&](double u, double v) {
    const Circle phi = on_circle(u * q.phi_max);
    return GridPoint{{q.radius * phi.cos, q.radius * phi.sin, q.z_min + v * (q.z_max - q.z_min)},
                     {phi.cos, phi.sin, 0},
                     to_uv(u, v)};
  });
  return mesh;
}

}  // namespace

Result<Mesh> load_pbrt_shape(std::string_view bytes, const std::string& name, std::int64_t offset, int line,
                             const Vec3d& origin, description::ReadingBudget& budget) {
  const Location where{name, line};
  if (offset < 0 || static_cast<std::uint64_t>(offset) >= bytes.size())
    return error_at(where, "the offset of a shape lies outside of the file");
  Tokens tokens(name, bytes, static_cast<std::size_t>(offset), line, nullptr, budget);
  CANDELA_ASSIGN(const auto word, tokens.next());
  if (!word || word->quoted || word->text != "Shape")
    return error_at(where, "no Shape directive begins at byte " + std::to_string(offset));
  CANDELA_ASSIGN(const auto type, tokens.next());
  if (!type || !type->quoted) return error_at(where, "the Shape directive names no type");
  const std::string kind(type->text);
  CANDELA_ASSIGN(ParameterList parameters, ParameterList::read(tokens));
  if (kind == "trianglemesh") return triangle_mesh(parameters, where, origin);
  if (kind == "bilinearmesh") return bilinear_mesh(parameters, where, origin, budget);
  if (kind == "loopsubdiv") return subdivision_mesh(parameters, where, origin, budget);
  if (kind != "sphere" && kind != "disk" && kind != "cylinder")
    return error_at(where, "a shape '" + kind + "' is not made of triangles");
  CANDELA_ASSIGN(const Quadric q, quadric(parameters, where, kind == "sphere"));
  Mesh mesh = kind == "sphere" ? sphere(q) : kind == "disk" ? disk(q) : cylinder(q);
  for (Vec3& p : mesh.positions) p = Vec3(Vec3d(p) - origin);
  return mesh;
}

}  // namespace candela::loaders
