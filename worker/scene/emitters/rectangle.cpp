#include "worker/scene/emitters/rectangle.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "worker/scene/emitters/double_math.h"

namespace candela::scene {
namespace {

double height(Vec3 reference, Vec3 front, Vec3 p) {
  return dot(Vec3d(front), Vec3d(p) - Vec3d(reference));
}

// The density of a point that the projection covers.
double pdf_parallel_solid_angle(const ParallelProjection& projection, Vec3 reference, Vec3 front, Vec3 p) {
  const Vec3d v = (Vec3d(p) - Vec3d(reference)) / height(reference, front, p);  // on the projection's plane
  const double squared = length_squared(v);
  return unit_plane_to_solid_angle(projection.area(), squared * std::sqrt(squared));
}

}  // namespace

RectangleSurface::RectangleSurface(const Rectangle& rectangle, float error)
    : rectangle_(rectangle), error_(error) {
  const Vec3d u(rectangle.edge_u), v(rectangle.edge_v);
  length_u_ = length(u);
  length_v_ = length(v);
  axis_u_ = u / length_u_;
  axis_v_ = v / length_v_;
  area_ = length(cross(u, v));
  center_ = rectangle.corner + (rectangle.edge_u + rectangle.edge_v) * 0.5f;
  const double diagonal_squared = length_u_ * length_u_ + length_v_ * length_v_;
  // Edges written as decimal text are perpendicular to some 1e-6.
  right_angled_ = std::abs(dot(axis_u_, axis_v_)) < 1e-5;
  near_squared_ =
      right_angled_ ? static_cast<float>(diagonal_squared) * kNearDiagonals * kNearDiagonals : 0.0f;
}

bool RectangleSurface::spherical(Vec3 reference, Spherical& s) const {
  if (!(length_squared(reference - center_) < near_squared_)) return false;
  const Vec3d d = Vec3d(rectangle_.corner) - Vec3d(reference);
  s.z0 = dot(d, Vec3d(rectangle_.normal));
  // In its plane the parameterization degenerates; area sampling does not mind.
  if (!(s.z0 < -1e-4 * std::max(length_u_, length_v_))) return false;
  s.x0 = dot(d, axis_u_);
  s.y0 = dot(d, axis_v_);
  s.x1 = s.x0 + length_u_;
  s.y1 = s.y0 + length_v_;
  // z components of the normals of the planes through the reference and each edge. The angles of the
  // spherical rectangle are acos(-n_i n_{i+1}) = pi/2 + asin(n_i n_{i+1}), whose sum less 2 pi is the solid
  // angle without cancellation of the pi/2. [Urena 2013, Sec. 3]
  const double zz = s.z0 * s.z0;
  const double n0 = -s.y0 / std::sqrt(zz + s.y0 * s.y0), n1 = s.x1 / std::sqrt(zz + s.x1 * s.x1);
  const double n2 = s.y1 / std::sqrt(zz + s.y1 * s.y1), n3 = -s.x0 / std::sqrt(zz + s.x0 * s.x0);
  const double a2 = asin_double(n2 * n3), a3 = asin_double(n3 * n0);
  s.solid_angle = asin_double(n0 * n1) + asin_double(n1 * n2) + a2 + a3;
  s.b0 = n0;
  s.b1 = n2;
  s.k = std::numbers::pi - a2 - a3;
  return s.solid_angle > 1e-4;
}

bool RectangleSurface::sample(Vec3 reference, double /*rest*/, Vec2 u, LightPoint& out) const {
  if (!reaches(reference)) return false;
  double along_u = static_cast<double>(u.x), along_v = static_cast<double>(u.y);
  Spherical s;
  const bool by_solid_angle = spherical(reference, s);
  if (by_solid_angle) {
    // [Urena 2013, Sec. 4]
    double sine = 0, cosine = 0;
    sincos_double(along_u * s.solid_angle + s.k, sine, cosine);
    const double fu = (cosine * s.b0 - s.b1) / sine;
    const double cu = std::clamp(std::copysign(1.0, fu) / std::sqrt(fu * fu + s.b0 * s.b0), -1.0, 1.0);
    double x = -(cu * s.z0) / std::sqrt(std::max(1 - cu * cu, 1e-300));
    if (!(x >= s.x0)) x = s.x0;
    x = std::min(x, s.x1);
    const double d2 = x * x + s.z0 * s.z0;
    const double h0 = s.y0 / std::sqrt(d2 + s.y0 * s.y0), h1 = s.y1 / std::sqrt(d2 + s.y1 * s.y1);
    const double h = h0 + along_v * (h1 - h0), h2 = h * h;
    const double y = h2 < 1 - 1e-14 ? h * std::sqrt(d2) / std::sqrt(1 - h2) : s.y1;
    along_u = std::clamp((x - s.x0) / length_u_, 0.0, 1.0);
    along_v = std::clamp((y - s.y0) / length_v_, 0.0, 1.0);
  }
  out.p = Vec3(Vec3d(rectangle_.corner) + Vec3d(rectangle_.edge_u) * along_u +
               Vec3d(rectangle_.edge_v) * along_v);
  out.ng = rectangle_.normal;
  out.uv = {static_cast<float>(along_u), static_cast<float>(along_v)};
  out.error = error_;
  if (!by_solid_angle) return finish_by_area(reference, area_, out);
  const Vec3d v = Vec3d(out.p) - Vec3d(reference);
  out.wi = Vec3(normalize(v));  // not zero: the reference is off the plane
  out.pdf_solid_angle = static_cast<float>(1 / s.solid_angle);
  return true;
}

void RectangleSurface::sample_area(double /*rest*/, Vec2 u, LightPoint& out) const {
  out.p = Vec3(Vec3d(rectangle_.corner) + Vec3d(rectangle_.edge_u) * static_cast<double>(u.x) +
               Vec3d(rectangle_.edge_v) * static_cast<double>(u.y));
  out.ng = rectangle_.normal;
  out.uv = u;
  out.error = error_;
}

float RectangleSurface::pdf_solid_angle(Vec3 reference, const SurfaceHit& hit) const {
  if (!reaches(reference)) return 0;
  Spherical s;
  if (spherical(reference, s)) return static_cast<float>(1 / s.solid_angle);
  return pdf_of_area_solid_angle(reference, hit.p, rectangle_.normal, area_);
}

// ---- by a sampler of points

SphericalRectangle RectangleSurface::rectangle_from(Vec3 reference) const {
  const Vec3d d = from(reference);
  const double x0 = dot(d, axis_u_), y0 = dot(d, axis_v_);
  return {x0, x0 + length_u_, y0, y0 + length_v_, -dot(d, Vec3d(rectangle_.normal))};
}

std::array<SphericalTriangle, 2> RectangleSurface::triangles_from(Vec3 reference) const {
  const Vec3d a = from(reference), u(rectangle_.edge_u), v(rectangle_.edge_v);
  const double each = volume(reference);
  return {SphericalTriangle(a, a + u, a + u + v, each), SphericalTriangle(a, a + u + v, a + v, each)};
}

ParallelProjection RectangleSurface::projection_from(Vec3 reference, Vec3 front) const {
  return {from(reference), Vec3d(rectangle_.edge_u), Vec3d(rectangle_.edge_v), volume(reference),
          Vec3d(front)};
}

double RectangleSurface::solid_angle_from(Vec3 reference) const {
  if (right_angled_) return rectangle_from(reference).solid_angle();
  const auto triangles = triangles_from(reference);
  return triangles[0].solid_angle() + triangles[1].solid_angle();
}

void RectangleSurface::place(Vec3 reference, TVec2<double> at, LightPoint& out) const {
  const Vec3d p =
      Vec3d(rectangle_.corner) + Vec3d(rectangle_.edge_u) * at.x + Vec3d(rectangle_.edge_v) * at.y;
  out.p = Vec3(p);
  out.ng = rectangle_.normal;
  out.uv = {static_cast<float>(at.x), static_cast<float>(at.y)};
  out.error = error_;
  out.wi = Vec3(normalize(p - Vec3d(reference)));  // not zero: the reference is off the plane
}

bool RectangleSurface::sample_by(PointSampler sampler, Vec3 reference, Vec3 front, double /*rest*/, Vec2 u,
                                 LightPoint& out) const {
  if (!reaches(reference)) return false;
  const TVec2<double> draw{static_cast<double>(u.x), static_cast<double>(u.y)};
  double pdf = 0;
  if (sampler == PointSampler::spherical && right_angled_) {
    const SphericalRectangle seen = rectangle_from(reference);
    pdf = 1 / seen.solid_angle();
    if (!usable_density(pdf)) return false;
    const Vec3d d = from(reference);
    const TVec2<double> p = seen.sample(draw.x, draw.y);
    place(reference, {(p.x - dot(d, axis_u_)) / length_u_, (p.y - dot(d, axis_v_)) / length_v_}, out);
  } else if (sampler == PointSampler::spherical) {
    const auto seen = triangles_from(reference);
    const double s0 = seen[0].solid_angle(), s = s0 + seen[1].solid_angle();
    pdf = 1 / s;
    if (!usable_density(pdf)) return false;
    const bool first = draw.x * s < s0;
    const double rest = first ? draw.x * s / s0 : (draw.x * s - s0) / (s - s0);
    const TVec2<double> b = seen[first ? 0 : 1].sample(std::clamp(rest, 0.0, 1.0), draw.y);
    // Corners 00, 10, 11 and 00, 11, 01.
    place(reference, first ? TVec2<double>{b.x + b.y, b.y} : TVec2<double>{b.x, b.x + b.y}, out);
  } else if (sampler == PointSampler::parallel && !is_zero(front)) {
    const ParallelProjection seen = projection_from(reference, front);
    if (!(seen.area() > 0)) return false;
    place(reference, seen.sample(draw.x, draw.y), out);
    pdf = pdf_parallel_solid_angle(seen, reference, front, out.p);
  } else {
    place(reference, draw, out);
    pdf = static_cast<double>(pdf_of_area_solid_angle(reference, out.p, rectangle_.normal, area_));
  }
  if (!usable_density(pdf)) return false;
  out.pdf_solid_angle = static_cast<float>(pdf);
  return true;
}

float RectangleSurface::pdf_by_solid_angle(PointSampler sampler, Vec3 reference, Vec3 front,
                                           const SurfaceHit& hit) const {
  if (!reaches(reference)) return 0;
  double pdf = 0;
  if (sampler == PointSampler::spherical) {
    pdf = 1 / solid_angle_from(reference);
  } else if (sampler == PointSampler::parallel && !is_zero(front)) {
    const ParallelProjection seen = projection_from(reference, front);
    if (seen.area() > 0 && seen.covers(height(reference, front, hit.p)))
      pdf = pdf_parallel_solid_angle(seen, reference, front, hit.p);
  } else {
    pdf = static_cast<double>(pdf_of_area_solid_angle(reference, hit.p, rectangle_.normal, area_));
  }
  return usable_density(pdf) ? static_cast<float>(pdf) : 0.0f;
}

template class AreaLight<RectangleSurface>;

}  // namespace candela::scene
