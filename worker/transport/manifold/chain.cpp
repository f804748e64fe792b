#include "worker/transport/manifold/chain.h"

#include <algorithm>
#include <cmath>

#include "common/base/enum_names.h"
#include "worker/transport/manifold/frame.h"

namespace candela::transport::manifold {

Vec3d Chain::to_light(std::size_t i) const {
  return i == 1 && from_direction() ? vertices[0].x : normalize(vertices[i - 1].x - vertices[i].x);
}

Vec3d Chain::to_sensor(std::size_t i) const {
  return normalize(vertices[i + 1].x - vertices[i].x);
}

double Chain::size() const {
  double longest = 0;
  for (std::size_t i = from_direction() ? 1 : 0; i + 1 < vertices.size(); ++i)
    longest = std::max(longest, length(vertices[i + 1].x - vertices[i].x));
  return longest;
}

bool orthonormalize(ChainVertex& v) {
  const double u = length(v.p_u);
  if (!(u > 0) || !std::isfinite(u)) return false;
  v.p_u = v.p_u / u;
  v.n_u = v.n_u / u;
  const double along = dot(v.p_u, v.p_v), whole = length(v.p_v);
  v.p_v = v.p_v - v.p_u * along;
  v.n_v = v.n_v - v.n_u * along;
  const double across = length(v.p_v);
  if (!(across > 1e-12 * whole) || !std::isfinite(across)) return false;
  v.p_v = v.p_v / across;
  v.n_v = v.n_v / across;
  return true;
}

const char* name_of(Fault fault) {
  return name_of_value<Fault::not_finite>({"none", "coincident", "grazing", "frame", "side", "not finite"},
                                          fault, "")
      .data();
}

namespace {

bool is_finite(Vec3d v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

Fault fault_at(const ChainVertex& v, Vec3d to_light, Vec3d to_sensor) {
  if (!has_pole_frame(v.n)) return Fault::frame;
  const Vec3d half = to_light + to_sensor * v.eta;
  const double l = length(half);
  if (!(std::abs(dot(v.n, half)) >= 1e-6 * l) || !(l > 0)) return Fault::grazing;
  const double by_shading = dot(to_light, v.n) * dot(to_sensor, v.n),
               by_geometry = dot(to_light, v.ng) * dot(to_sensor, v.ng);
  const bool fits = v.scatter == Scatter::reflect
                        ? by_shading > 0 && by_geometry > 0
                        : by_shading < 0 && by_geometry < 0 && dot(to_light, half) * dot(to_sensor, half) < 0;
  return fits ? Fault::none : Fault::side;
}

}  // namespace

Fault fault_of(const Chain& chain) {
  for (const ChainVertex& v : chain.vertices)
    if (!is_finite(v.x) || !is_finite(v.n)) return Fault::not_finite;
  const double shortest = 1e-6 * chain.size();
  for (std::size_t i = chain.from_direction() ? 1 : 0; i + 1 < chain.vertices.size(); ++i)
    if (!(length(chain.vertices[i + 1].x - chain.vertices[i].x) > shortest)) return Fault::coincident;
  for (std::size_t i = 1; i + 1 < chain.vertices.size(); ++i)
    if (const Fault fault = fault_at(chain.vertices[i], chain.to_light(i), chain.to_sensor(i));
        fault != Fault::none)
      return fault;
  return Fault::none;
}

}  // namespace candela::transport::manifold
