// The geometric part of a chain's contribution, in area measure and in the measure of half vectors
// [half-vector note, sections 1 and 7; Kaplanyan 2017, Eq. 7.5 and 7.7], and the acceptance of mutations of a
// chain alone.
//
//   prod G_i / |J| = |d o_0_perp / d x_k|_c  prod |d o_i_perp / d c_i|
//
// The right side needs no 1 / l^2 and no inverse: pencil() has its first factor by two differentials that
// run along the chain [Igehy 1999]. It keeps its digits in corners, where the left side loses them.
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "worker/core/math.h"
#include "worker/transport/manifold/chain.h"
#include "worker/transport/manifold/constraint.h"
#include "worker/transport/manifold/frame.h"
#include "worker/transport/manifold/proposal.h"

namespace candela::transport::manifold {

// Two differentials along the chain: of the position, and of the direction.
struct Pencil {
  std::array<Vec3d, 2> p, q;
};

// By w over a distance of l, then back onto the surface of v.
inline void transfer(Pencil& pencil, Vec3d w, double l, const ChainVertex& v) {
  const double fall = dot(v.ng, w);
  for (std::size_t k = 0; k < 2; ++k) {
    pencil.p[k] += pencil.q[k] * l;
    pencil.p[k] = pencil.p[k] - w * (dot(v.ng, pencil.p[k]) / fall);
  }
}

inline Mat2 tangential(const Pencil& pencil, const ChainVertex& v) {
  return {dot(v.p_u, pencil.p[0]), dot(v.p_u, pencil.p[1]), dot(v.p_v, pencil.p[0]), dot(v.p_v, pencil.p[1])};
}

// Turns at v with its slope c held; i: towards the light. The new direction's differential replaces q.
inline void scatter(Pencil& pencil, const ChainVertex& v, Vec3d i, Pair c) {
  const auto [s, t] = pole_frame(v.n);
  const Mat2 u = tangential(pencil, v);
  const Vec3d m = s * c.x + t * c.y + v.n;
  const double side = dot(i, m) < 0 ? -1 : 1;
  const double l = length(m);
  const Vec3d h = m * (side / l);
  const double z = dot(i, h);
  for (std::size_t k = 0; k < 2; ++k) {
    const Vec3d dn = v.n_u * (k == 0 ? u.xx : u.xy) + v.n_v * (k == 0 ? u.yx : u.yy);
    const double turn = spin(v.n, dn);
    const Vec3d ds = t * turn - v.n * dot(s, dn), dt = -(s * turn) - v.n * dot(t, dn);
    const Vec3d dm = ds * c.x + dt * c.y + dn;
    const Vec3d dh = (dm - h * dot(h, dm)) * (side / l);
    const Vec3d di = -pencil.q[k];
    const double dz = dot(di, h) + dot(i, dh);
    if (v.scatter == Scatter::reflect) {
      pencil.q[k] = h * (2 * dz) + dh * (2 * z) - di;
      continue;
    }
    const double q = std::sqrt(1 - (1 - z * z) / (v.eta * v.eta));
    pencil.q[k] = h * (dz * (1 / v.eta - z / (v.eta * v.eta * q))) + dh * (z / v.eta - q) - di / v.eta;
  }
}

// |h.n| of the unit half vector h at vertex i.
inline double half_cosine(const Chain& chain, std::size_t i) {
  const Vec3d h = chain.to_light(i) + chain.to_sensor(i) * chain.vertices[i].eta;
  return std::abs(dot(h, chain.vertices[i].n)) / length(h);
}

// G_i of the edge from vertex i to the next one: the shading normal's cosine here, the geometric one there.
// From a direction: the cosine there alone.
inline double geometry_term(const Chain& chain, std::size_t i) {
  const ChainVertex& after = chain.vertices[i + 1];
  if (i == 0 && chain.from_direction()) return std::abs(dot(chain.vertices[0].x, after.ng));
  const Vec3d d = after.x - chain.vertices[i].x;
  const double l2 = length_squared(d);
  const Vec3d w = d / std::sqrt(l2);
  const double near = i == 0 && chain.first == FirstEnd::point ? 1 : std::abs(dot(w, chain.vertices[i].n));
  return near * std::abs(dot(w, after.ng)) / l2;
}

// |d o_perp / d c| at vertex i for a fixed direction towards the light.
inline double projected_by_constraint(Form form, const Chain& chain, std::size_t index) {
  const ChainVertex& v = chain.vertices[index];
  const Vec3d i = chain.to_light(index), o = chain.to_sensor(index);
  const Vec3d h = normalize(i + o * v.eta);
  const double along_i = dot(i, h), along_o = dot(o, h), cosine = std::abs(dot(h, v.n));
  const double both = along_i + v.eta * along_o;
  // [Walter 2007] for refraction; [Kaplanyan 2017, Eq. 7.7] for reflection.
  const double disk = both * both / (v.eta * v.eta * std::abs(along_o)) * std::abs(dot(o, v.n)) / cosine;
  return form == Form::disk ? disk : disk * (cosine * cosine) * (cosine * cosine);
}

// log |d o_0_perp / d x_k| with all slopes fixed: the log of the generalized geometric term from the first
// end to the last. From a direction: of the area across it. Infinite at a caustic on x_k.
inline double log_pencil(const Chain& chain) {
  const std::size_t k = chain.vertices.size() - 1;
  const ChainVertex& first = chain.vertices[0];
  Vec3d w = chain.from_direction() ? -first.x : normalize(chain.vertices[1].x - first.x);
  const double cosine = chain.first == FirstEnd::surface ? std::abs(dot(w, first.n)) : 1;
  const auto [s, t] = has_pole_frame(w) ? pole_frame(w) : PoleFrame{kPoleS, kPoleT};
  Pencil pencil;
  (chain.from_direction() ? pencil.p : pencil.q) = {s, t};
  for (std::size_t i = 1; i <= k; ++i) {
    const ChainVertex& v = chain.vertices[i];
    const double l = i == 1 && chain.from_direction() ? 0 : length(v.x - chain.vertices[i - 1].x);
    transfer(pencil, w, l, v);
    if (i == k) break;
    scatter(pencil, v, -w, constraint(Form::slope, chain, i));
    w = chain.to_sensor(i);
  }
  const double area = std::abs(det(tangential(pencil, chain.vertices[k])));
  if (!(area > 0)) return std::numeric_limits<double>::infinity();
  return math::log(cosine) - math::log(area);
}

// log of prod G_i / |J| by the pencil, in the form's measure. specular: by inner vertex, whether its
// constraint is held: then its factor is left to the bsdf; empty: none.
inline double log_contribution(Form form, const Chain& chain, const std::vector<bool>& specular = {}) {
  double sum = log_pencil(chain);
  for (std::size_t i = 1; i <= chain.inner_count(); ++i)
    if (specular.empty() || !specular[i - 1]) sum += math::log(projected_by_constraint(form, chain, i));
  return sum;
}

inline double log_contribution_of(const PreparedChain& prepared) {
  std::vector<bool> specular;
  for (const double alpha : prepared.alphas) specular.push_back(!(alpha > 0));
  return log_contribution(Form::slope, prepared.chain, specular);
}

inline double log_geometry(const Chain& chain) {
  double sum = 0;
  for (std::size_t i = 0; i <= chain.inner_count(); ++i) sum += math::log(geometry_term(chain, i));
  return sum;
}

// The log of what multiplies the quotient f_s(to) / f_s(from) in the acceptance of a walk, f_s the product of
// the bsdfs, emission and importance (of a specular vertex the factor of its delta lobe): geometry over
// |J|, and both densities [half-vector note, section 11].
inline double log_quotient_walk(const PreparedChain& from, const PreparedChain& to) {
  return log_contribution_of(to) - log_contribution_of(from) + log_pdf_slopes(to, from.slopes) -
         log_pdf_slopes(from, to.slopes);
}

// As log_quotient_walk(): geometry, and both densities in area measure. Nothing: one of them is zero.
inline std::optional<double> log_quotient_one_step(const PreparedChain& from, const PreparedChain& to) {
  const auto forward = log_pdf_one_step_area(from, to.chain), back = log_pdf_one_step_area(to, from.chain);
  if (!forward || !back) return std::nullopt;
  return log_geometry(to.chain) - log_geometry(from.chain) + *back - *forward;
}

}  // namespace candela::transport::manifold
