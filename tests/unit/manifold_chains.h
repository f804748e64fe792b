// Chains over analytic surfaces, which tests of half vectors can move by their own parameters.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include "common/rng/stream.h"
#include "worker/transport/manifold/chain.h"
#include "worker/transport/manifold/constraint.h"
#include "worker/transport/manifold/frame.h"
#include "worker/transport/manifold/surfaces.h"

namespace candela::test {

using namespace transport::manifold;  // NOLINT(google-build-using-namespace)

inline double between(rng::Stream& stream, double low, double high) {
  return low + (high - low) * stream.next_double();
}
inline Pair normals(rng::Stream& stream) {
  const double r = std::sqrt(-2 * std::log(1 - stream.next_double()));
  const double a = 2 * std::numbers::pi * stream.next_double();
  return {r * std::cos(a), r * std::sin(a)};
}
inline Vec3d normal_vector(rng::Stream& stream) {
  const Pair a = normals(stream);
  return {a.x, a.y, normals(stream).x};
}
inline Vec3d direction(rng::Stream& stream) {
  return normalize(normal_vector(stream));
}

inline void set_tangents(ChainVertex& v, Vec3d n) {
  const auto [s, t] = pole_frame(n);
  v.p_u = s;
  v.p_v = t;
}

// A surface that knows its point at tangent coordinates (u, v) around a vertex on it, by its own arithmetic.
struct LocalSurface {
  virtual ~LocalSurface() = default;
  virtual ChainVertex at(double u, double v) const = 0;  // place and normals alone
};

struct LocalPlane : LocalSurface {
  ChainVertex here;
  ChainVertex at(double u, double v) const override {
    ChainVertex out = here;
    out.x = here.x + here.p_u * u + here.p_v * v;
    return out;
  }
};
struct LocalSphere : LocalSurface {
  ChainVertex here;
  Vec3d center;
  double radius = 1, side = 1;
  ChainVertex at(double u, double v) const override {
    ChainVertex out = here;
    const Vec3d out_of = normalize(here.x + here.p_u * u + here.p_v * v - center);
    out.x = center + out_of * radius;
    out.n = out.ng = out_of * side;
    return out;
  }
};
struct LocalTriangle : LocalSurface {
  ChainVertex here;
  Vec3d n_0, n_u, n_v;  // the interpolated normal before it is normalized, linear in u and v
  ChainVertex at(double u, double v) const override {
    ChainVertex out = here;
    out.x = here.x + here.p_u * u + here.p_v * v;
    out.n = normalize(n_0 + n_u * u + n_v * v);
    return out;
  }
};
struct LocalDirection : LocalSurface {
  ChainVertex here;
  ChainVertex at(double u, double v) const override {
    ChainVertex out = here;
    out.x = normalize(here.x + here.p_u * u + here.p_v * v);
    return out;
  }
};

struct RandomChain {
  Chain chain;
  std::vector<std::unique_ptr<LocalSurface>> surfaces;  // by vertex
};

// A surface of a random kind with a vertex at x, its geometric and shading normal about n.
inline std::unique_ptr<LocalSurface> random_surface(rng::Stream& stream, Vec3d x, Vec3d n, ChainVertex& v) {
  v.x = x;
  v.n = v.ng = n;
  const double kind = stream.next_double();
  if (kind < 1.0 / 3) {
    set_tangents(v, n);
    auto plane = std::make_unique<LocalPlane>();
    plane->here = v;
    return plane;
  }
  if (kind < 2.0 / 3) {
    set_tangents(v, n);
    auto sphere = std::make_unique<LocalSphere>();
    sphere->radius = between(stream, 0.4, 3);
    sphere->side = stream.next_double() < 0.5 ? -1 : 1;
    sphere->center = x - n * (sphere->side * sphere->radius);
    v.n_u = v.p_u * (sphere->side / sphere->radius);
    v.n_v = v.p_v * (sphere->side / sphere->radius);
    sphere->here = v;
    return sphere;
  }
  auto triangle = std::make_unique<LocalTriangle>();
  v.ng = normalize(n + normal_vector(stream) * 0.15);
  set_tangents(v, v.ng);
  triangle->n_0 = n * between(stream, 0.7, 1);
  triangle->n_u = normal_vector(stream) * 0.4;
  triangle->n_v = normal_vector(stream) * 0.4;
  const double l = length(triangle->n_0);
  v.n_u = (triangle->n_u - n * dot(n, triangle->n_u)) / l;
  v.n_v = (triangle->n_v - n * dot(n, triangle->n_v)) / l;
  triangle->here = v;
  return triangle;
}

// A chain that microfacets could make, of `count` inner vertices.
inline RandomChain random_chain(rng::Stream& stream, std::size_t count, FirstEnd first) {
  for (;;) {
    RandomChain out;
    out.chain.first = first;
    auto& vertices = out.chain.vertices;
    Vec3d d = direction(stream), x = direction(stream);
    const auto end = [&](Vec3d n) {
      ChainVertex v;
      v.x = x;
      v.n = v.ng = n;
      set_tangents(v, n);
      auto plane = std::make_unique<LocalPlane>();
      plane->here = v;
      vertices.push_back(v);
      out.surfaces.push_back(std::move(plane));
    };
    end(first == FirstEnd::surface ? normalize(d + normal_vector(stream) * 0.5) : d);
    if (first == FirstEnd::direction) {
      ChainVertex& v = vertices.back();
      v.x = v.n = v.ng = -d;
      set_tangents(v, -d);
      auto far = std::make_unique<LocalDirection>();
      far->here = v;
      out.surfaces.back() = std::move(far);
    }
    for (std::size_t i = 0; i < count; ++i) {
      x += d * between(stream, 0.5, 2);
      Vec3d n = direction(stream);
      if (dot(n, d) > 0) n = -n;
      ChainVertex v;
      out.surfaces.push_back(random_surface(stream, x, n, v));
      const auto [s, t] = pole_frame(v.n);
      const Pair slope = normals(stream) * 0.35;
      const Vec3d facet = normalize(s * slope.x + t * slope.y + v.n);
      const double cosine = -dot(d, facet);
      if (cosine < 0.1 || dot(d, v.n) > -0.15) break;
      if (stream.next_double() < 0.5) {
        v.scatter = Scatter::reflect;
        d = facet * (2 * cosine) + d;
      } else {
        v.scatter = Scatter::refract;
        const double indices[] = {1.5, 1 / 1.5, 1.33, 2.4};
        v.eta = indices[static_cast<std::size_t>(stream.next_double() * 4)];
        const double rest = 1 - (1 - cosine * cosine) / (v.eta * v.eta);
        if (rest <= 0) break;
        d = d / v.eta + facet * (cosine / v.eta - std::sqrt(rest));
      }
      if (std::abs(dot(d, v.n)) < 0.15 || std::abs(dot(d, v.ng)) < 0.1) break;
      vertices.push_back(v);
    }
    if (vertices.size() != count + 1) continue;
    x += d * between(stream, 0.5, 2);
    end(normalize(normal_vector(stream) * 0.4 - d));
    if (fault_of(out.chain) == Fault::none) return out;
  }
}

// A plane z = height, or a sphere, that rays meet; of a list by inner vertex.
struct SimpleSurface {
  bool round = false;
  Vec3d center;  // of a plane a point on it
  double radius = 1;
};
class SimpleSurfaces final : public Surfaces {
 public:
  explicit SimpleSurfaces(std::vector<SimpleSurface> list) : list_(std::move(list)) {}

  bool meet(std::size_t i, const ChainVertex& start, Vec3d towards, ChainVertex& out) const override {
    const Vec3d from = start.x;
    const SimpleSurface& surface = list_[i - 1];
    const Vec3d d = normalize(towards - from);
    if (!surface.round) {
      if (std::abs(d.z) < 1e-9) return false;
      const double t = (surface.center.z - from.z) / d.z;
      if (!(t > 1e-9)) return false;
      set(i, from + d * t, out);
      return true;
    }
    const Vec3d q = from - surface.center;
    const double b = dot(q, d), rest = b * b - dot(q, q) + surface.radius * surface.radius;
    if (!(rest > 1e-12)) return false;
    const double t = -b - std::sqrt(rest);
    if (!(t > 1e-9)) return false;
    set(i, surface.center + normalize(q + d * t) * surface.radius, out);
    return true;
  }
  // The vertex at x.
  void set(std::size_t i, Vec3d x, ChainVertex& out) const {
    const SimpleSurface& surface = list_[i - 1];
    out.x = x;
    out.n = out.ng = surface.round ? (x - surface.center) / surface.radius : Vec3d{0, 0, 1};
    set_tangents(out, out.n);
    out.n_u = surface.round ? out.p_u / surface.radius : Vec3d{};
    out.n_v = surface.round ? out.p_v / surface.radius : Vec3d{};
  }

 private:
  std::vector<SimpleSurface> list_;
};

inline ChainVertex end_at(Vec3d x, Vec3d towards) {
  ChainVertex v;
  v.x = x;
  v.n = v.ng = normalize(towards - x);
  set_tangents(v, v.n);
  return v;
}

// Light in air above an interface of index 1.5, a sphere and the sensor below it: refraction, then
// reflection. x, y: of the first vertex; direction: of the second from the center of the sphere.
inline SimpleSurfaces two_vertex_surfaces() {
  return SimpleSurfaces({{false, {0, 0, 0}, 1}, {true, {0.3, 0, -2.2}, 0.8}});
}
inline Chain two_vertex_chain(const SimpleSurfaces& surfaces, double x, double y, Vec3d from_center) {
  Chain chain;
  chain.vertices.resize(4);
  chain.vertices[1].scatter = Scatter::refract;
  chain.vertices[1].eta = 1.5;
  chain.vertices[2].scatter = Scatter::reflect;
  surfaces.set(1, {x, y, 0}, chain.vertices[1]);
  surfaces.set(2, Vec3d{0.3, 0, -2.2} + normalize(from_center) * 0.8, chain.vertices[2]);
  chain.vertices[0] = end_at({0.5, 0.2, 1.5}, chain.vertices[1].x);
  chain.vertices[3] = end_at({-1.6, 0.4, -1.5}, chain.vertices[2].x);
  return chain;
}

// Dense, by inner vertex.
using Dense = std::vector<std::vector<double>>;
inline Dense dense(const std::vector<Blocks>& blocks) {
  const std::size_t n = blocks.size();
  Dense m(2 * n, std::vector<double>(2 * n));
  const auto put = [&](std::size_t row, std::size_t column, const Mat2& b) {
    m[2 * row][2 * column] = b.xx;
    m[2 * row][2 * column + 1] = b.xy;
    m[2 * row + 1][2 * column] = b.yx;
    m[2 * row + 1][2 * column + 1] = b.yy;
  };
  for (std::size_t i = 0; i < n; ++i) {
    put(i, i, blocks[i].b);
    if (i > 0) put(i, i - 1, blocks[i].a);
    if (i + 1 < n) put(i, i + 1, blocks[i].c);
  }
  return m;
}
// Gauss and Jordan with pivots; the determinant.
inline double invert(Dense m, Dense& inverse) {
  const std::size_t n = m.size();
  inverse.assign(n, std::vector<double>(n));
  for (std::size_t i = 0; i < n; ++i) inverse[i][i] = 1;
  double determinant = 1;
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t pivot = k;
    for (std::size_t i = k; i < n; ++i)
      if (std::abs(m[i][k]) > std::abs(m[pivot][k])) pivot = i;
    if (pivot != k) {
      std::swap(m[k], m[pivot]);
      std::swap(inverse[k], inverse[pivot]);
      determinant = -determinant;
    }
    determinant *= m[k][k];
    const double p = 1 / m[k][k];
    for (std::size_t j = 0; j < n; ++j) {
      m[k][j] *= p;
      inverse[k][j] *= p;
    }
    for (std::size_t i = 0; i < n; ++i) {
      if (i == k) continue;
      const double f = m[i][k];
      for (std::size_t j = 0; j < n; ++j) {
        m[i][j] -= f * m[k][j];
        inverse[i][j] -= f * inverse[k][j];
      }
    }
  }
  return determinant;
}

}  // namespace candela::test
