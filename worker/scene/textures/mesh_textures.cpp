#include "worker/scene/textures/mesh_textures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

namespace candela::scene {
namespace {

class MeshAttribute final : public Texture {
 public:
  MeshAttribute(const Geometry& geometry, const Attribute& attribute, float scale)
      : geometry_(geometry), attribute_(attribute), scale_(scale) {}

  Spectrum eval(const SurfacePoint& at) const override {
    if (attribute_.of_faces) return corner(at.primitive, at.primitive);
    const std::array<Spectrum, 3> c = corners(at.primitive);
    const Vec2 b = at.barycentric;
    // Rounding leaves no value beyond those of the corners.
    const auto mix = [&](float x, float y, float z) {
      return std::clamp(x * (1 - b.x - b.y) + y * b.x + z * b.y, std::min({x, y, z}), std::max({x, y, z}));
    };
    return {mix(c[0].r, c[1].r, c[2].r), mix(c[0].g, c[1].g, c[2].g), mix(c[0].b, c[1].b, c[2].b)};
  }

  TextureGradient gradient(const SurfacePoint& at) const override {
    if (attribute_.of_faces) return {};
    const std::array<Spectrum, 3> c = corners(at.primitive);
    const Spectrum d1 = c[1] - c[0], d2 = c[2] - c[0];
    if (!geometry_.triangles[at.primitive].mapped) return {finite(d1, d2, 1, 0), finite(d1, d2, 0, 1)};
    const auto& v = geometry_.indices[at.primitive];
    const Vec2 p0 = geometry_.uvs[v[0]], p1 = geometry_.uvs[v[1]], p2 = geometry_.uvs[v[2]];
    const double du1 = difference(p1.x, p0.x), dv1 = difference(p1.y, p0.y);
    const double du2 = difference(p2.x, p0.x), dv2 = difference(p2.y, p0.y);
    const double determinant = du1 * dv2 - dv1 * du2;
    if (determinant == 0) return {};
    return {finite(d1, d2, dv2 / determinant, -dv1 / determinant),
            finite(d1, d2, -du2 / determinant, du1 / determinant)};
  }

  Spectrum maximum() const override {
    return (scale_ < 0 ? attribute_.minimum : attribute_.maximum) * scale_;
  }
  Spectrum minimum() const override {
    return (scale_ < 0 ? attribute_.maximum : attribute_.minimum) * scale_;
  }

 private:
  static double difference(float a, float b) { return static_cast<double>(a) - static_cast<double>(b); }
  static Spectrum finite(Spectrum d1, Spectrum d2, double k1, double k2) {
    const auto sum = [&](float a, float b) {
      constexpr double largest = std::numeric_limits<float>::max();
      return static_cast<float>(
          std::clamp(static_cast<double>(a) * k1 + static_cast<double>(b) * k2, -largest, largest));
    };
    return {sum(d1.r, d2.r), sum(d1.g, d2.g), sum(d1.b, d2.b)};
  }
  Spectrum corner(std::uint32_t triangle, std::uint32_t index) const {
    return attribute_.values[attribute_.first[geometry_.triangles[triangle].shape] + index] * scale_;
  }
  std::array<Spectrum, 3> corners(std::uint32_t triangle) const {
    const auto& v = geometry_.indices[triangle];
    return {corner(triangle, v[0]), corner(triangle, v[1]), corner(triangle, v[2])};
  }

  const Geometry& geometry_;
  const Attribute& attribute_;
  float scale_;
};

class Wireframe final : public Texture {
 public:
  Wireframe(const Geometry& geometry, const ColorTexture& interior, const ColorTexture& edges, double width,
            double step)
      : geometry_(geometry), interior_(interior), edges_(edges), width_(width), step_(step) {}

  Spectrum eval(const SurfacePoint& at) const override {
    if (at.primitive == kNone) return interior_.eval(at);  // no triangle
    const auto a = static_cast<float>(share_of_interior(at));
    return edges_.eval(at) * (1 - a) + interior_.eval(at) * a;
  }
  TextureGradient gradient(const SurfacePoint& /*at*/) const override { return {}; }
  Spectrum maximum() const override { return max(interior_.maximum(), edges_.maximum()); }
  Spectrum minimum() const override { return min(interior_.minimum(), edges_.minimum()); }

 private:
  double share_of_interior(const SurfacePoint& at) const {
    const Triangle& t = geometry_.triangles[at.primitive];
    const double width = width_ > 0 ? width_ : 0.1 * geometry_.mean_edges[t.shape];
    const Vec3d v0(t.v0), v1(t.v1), v2(t.v2);
    const double twice_area = length(cross(v1 - v0, v2 - v0));
    const auto b1 = static_cast<double>(at.barycentric.x), b2 = static_cast<double>(at.barycentric.y);
    // A corner's weight is the height over the edge opposite to it, as a part of the triangle's.
    const double nearest = std::min({std::max(1 - b1 - b2, 0.0) * twice_area / length(v2 - v1),
                                     b1 * twice_area / length(v2 - v0), b2 * twice_area / length(v1 - v0)});
    const double begin = width * (1 - step_);
    if (nearest >= width) return 1;
    if (!(nearest > begin)) return 0;
    const double x = (nearest - begin) / (width - begin);
    return x * x * (3 - 2 * x);
  }

  const Geometry& geometry_;
  ColorTexture interior_, edges_;
  double width_, step_;
};

Error located(std::string message, const description::Object& object, std::string field) {
  return input_error(std::move(message))
      .at(object.where.file, object.where.line)
      .with_field(std::move(field));
}

}  // namespace

Result<std::unique_ptr<const Texture>> mesh_attribute(const description::Object& object,
                                                      const Geometry& geometry) {
  const auto found = geometry.attributes.find(object.get_string("name", ""));
  if (found == geometry.attributes.end())
    return located("only the surface of a mesh has attributes", object, "name");
  const auto scale = static_cast<float>(object.get_number("scale", 1));
  auto texture = std::make_unique<MeshAttribute>(geometry, found->second, scale);
  for (const Spectrum bound : {texture->minimum(), texture->maximum()})
    for (const float component : {bound.r, bound.g, bound.b})
      if (!std::isfinite(component))
        return located("the attribute times its scale is finite", object, "scale");
  return std::unique_ptr<const Texture>(std::move(texture));
}

std::unique_ptr<const Texture> wireframe(const description::Object& object, const ColorTexture& interior,
                                         const ColorTexture& edges, const Geometry& geometry) {
  return std::make_unique<Wireframe>(geometry, interior, edges, object.get_number("line_width", 0),
                                     object.get_number("step_width", 0.5));
}

}  // namespace candela::scene
