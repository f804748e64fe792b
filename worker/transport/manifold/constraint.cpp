#include "worker/transport/manifold/constraint.h"

#include <cmath>

#include "worker/transport/manifold/frame.h"

namespace candela::transport::manifold {
namespace {

Vec3d across(Vec3d d, Vec3d v) {
  return v - d * dot(d, v);
}

struct HalfVector {
  PoleFrame frame;
  Vec3d i, o, h;  // h: not normalized
  Pair c;
  Vec3d e_s, e_t;  // dc = (e_s . dH, e_t . dH) for a fixed frame
};

HalfVector half_vector(Form form, const Chain& chain, std::size_t index) {
  const ChainVertex& v = chain.vertices[index];
  HalfVector out;
  out.frame = pole_frame(v.n);
  out.i = chain.to_light(index);
  out.o = chain.to_sensor(index);
  out.h = out.i + out.o * v.eta;
  const auto [s, t] = out.frame;
  const double along = dot(v.n, out.h);
  if (form == Form::slope) {
    out.c = {dot(s, out.h) / along, dot(t, out.h) / along};
    out.e_s = (s - v.n * out.c.x) / along;
    out.e_t = (t - v.n * out.c.y) / along;
    return out;
  }
  const double scale = std::copysign(1 / length(out.h), along);
  const Vec3d h = out.h * scale;  // unit, on the normal's side
  out.c = {dot(s, h), dot(t, h)};
  out.e_s = across(h, s) * scale;
  out.e_t = across(h, t) * scale;
  return out;
}

// Columns u and v.
Mat2 columns(const HalfVector& half, Vec3d u, Vec3d v) {
  return {dot(half.e_s, u), dot(half.e_s, v), dot(half.e_t, u), dot(half.e_t, v)};
}

}  // namespace

Pair constraint(Form form, const Chain& chain, std::size_t i) {
  return half_vector(form, chain, i).c;
}

Blocks blocks(Form form, const Chain& chain, std::size_t index) {
  const ChainVertex &before = chain.vertices[index - 1], &v = chain.vertices[index],
                    &after = chain.vertices[index + 1];
  const HalfVector half = half_vector(form, chain, index);
  const auto [s, t] = half.frame;
  const bool infinite = index == 1 && chain.from_direction();
  // A step of the direction to the light is a step of i itself; a step here leaves it as it is.
  const double per_i = infinite ? 0 : 1 / length(before.x - v.x);
  const double per_before = infinite ? 1 : per_i;
  const double per_o = v.eta / length(after.x - v.x);
  const Pair c = half.c;
  Blocks out;
  out.a = columns(half, across(half.i, before.p_u), across(half.i, before.p_v)) * per_before;
  out.c = columns(half, across(half.o, after.p_u), across(half.o, after.p_v)) * per_o;
  out.b = columns(half, -(across(half.i, v.p_u) * per_i + across(half.o, v.p_u) * per_o),
                  -(across(half.i, v.p_v) * per_i + across(half.o, v.p_v) * per_o));
  const Mat2 bend{dot(s, v.n_u), dot(s, v.n_v), dot(t, v.n_u), dot(t, v.n_v)};
  if (form == Form::slope) {
    out.b = out.b - Mat2{1 + c.x * c.x, c.x * c.y, c.x * c.y, 1 + c.y * c.y} * bend;
  } else {
    out.b = out.b - bend * (std::abs(dot(v.n, half.h)) / length(half.h));
  }
  const double spin_u = spin(v.n, v.n_u), spin_v = spin(v.n, v.n_v);
  out.b = out.b + Mat2{c.y * spin_u, c.y * spin_v, -c.x * spin_u, -c.x * spin_v};
  return out;
}

std::vector<Pair> constraints(Form form, const Chain& chain) {
  std::vector<Pair> out;
  out.reserve(chain.inner_count());
  for (std::size_t i = 1; i <= chain.inner_count(); ++i) out.push_back(constraint(form, chain, i));
  return out;
}

std::vector<Blocks> blocks(Form form, const Chain& chain) {
  std::vector<Blocks> out;
  out.reserve(chain.inner_count());
  for (std::size_t i = 1; i <= chain.inner_count(); ++i) out.push_back(blocks(form, chain, i));
  return out;
}

double light_angle_by_constraint(const Chain& chain, std::size_t index) {
  const ChainVertex& v = chain.vertices[index];
  const Vec3d i = chain.to_light(index), o = chain.to_sensor(index);
  const Vec3d h = normalize(i + o * v.eta);
  const double along_i = dot(i, h), cosine = std::abs(dot(h, v.n));
  // [Walter 2007, Eq. 17], [Kaplanyan 2017, Eq. 7.7] with the ends exchanged, and without the cosine of i.
  const double both = along_i + v.eta * dot(o, h);
  return both * both / std::abs(along_i) * (cosine * cosine * cosine);
}

}  // namespace candela::transport::manifold
