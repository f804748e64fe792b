// s, t >= 2: a light and an eye vertex joined by an edge.
#pragma once

#include <cmath>
#include <cstdint>

#include "worker/core/measure.h"
#include "worker/transport/technique/contribution.h"

namespace candela::transport {

// A word beside the key of a connection's transmittance.
inline constexpr std::uint64_t kWhetherToConnect = 0x636f6e6eULL;  // "conn"

// The samples of connecting z and y per pair: 1, or of two vertices in media a share of the pairs.
template <class Mis>
double connections(const ConnectContext& c, const ScatterPoint& z, const ScatterPoint& y) {
  if constexpr (Mis::kMergesBeams)
    if (!z.on_surface() && !y.on_surface()) return c.factors.connect_media;
  return 1;
}

// The light's vertex z connected to the eye's vertex y.
template <EdgeContent kEdgeContent, class Mis>
bool connect(const ConnectContext& c, const Vertex<typename Mis::Block>& z,
             const Vertex<typename Mis::Block>& y, std::uint64_t stream_key, const MergeFactors& eta,
             Contribution& out, WeightTerms* terms = nullptr) {
  const double share = connections<Mis>(c, z, y);
  if (share < 1 && rng::to_double(rng::combine(stream_key, kWhetherToConnect)) >= share) return false;
  const Vec3d between = Vec3d(z.hit.p) - Vec3d(y.hit.p);
  const double distance_squared = length_squared(between);
  if (!(distance_squared > 0)) return false;
  const Vec3 to_light = Vec3(between / std::sqrt(distance_squared));
  if (!may_meet<kEdgeContent>(c, y, z, to_light)) return false;
  float pdf_eye = 0, pdf_light = 0;
  const Spectrum at_eye = scatter_value(c.scene, y, y.wo, to_light, TransportMode::radiance, pdf_eye);
  if (at_eye.is_black()) return false;
  const Spectrum at_light = scatter_value(c.scene, z, z.wo, -to_light, TransportMode::importance, pdf_light);
  if (at_light.is_black()) return false;
  const Ray ray = spawn_shadow_ray(y.hit, z.hit.p, z.on_surface() ? z.hit.ng : Vec3{}, z.hit.error);
  double survival = 1;
  const Spectrum passed = visibility<kEdgeContent>(c, y, ray, stream_key, survival);
  if (passed.is_black()) return false;
  out.value =
      y.throughput * at_eye * passed * at_light * z.throughput * static_cast<float>(1 / distance_squared);
  if (share < 1) out.value *= static_cast<float>(1 / share);
  out.weight = 1;
  if constexpr (Mis::kWeighs) {
    const double spread = survival / distance_squared;
    const double light_step = solid_angle_to_area_by_spread(static_cast<double>(pdf_eye), spread,
                                                            static_cast<double>(z.density_factor(to_light)));
    const double eye_step = solid_angle_to_area_by_spread(static_cast<double>(pdf_light), spread,
                                                          static_cast<double>(y.density_factor(to_light)));
    const auto light_reverse =
        static_cast<double>(pdf_scatter_solid_angle(c.scene, z, -to_light, z.wo, TransportMode::radiance));
    const auto eye_reverse =
        static_cast<double>(pdf_scatter_solid_angle(c.scene, y, to_light, y.wo, TransportMode::importance));
    const double merged_z = merges_at<Mis>(c, SubpathOf::light, z, -to_light, survival, eta);
    const double merged_y = merges_at<Mis>(c, SubpathOf::eye, y, to_light, survival, eta);
    const double light_sum = merged_z + Mis::sum(z.mis, light_reverse, eta);
    const double eye_sum = merged_y + Mis::sum(y.mis, eye_reverse, eta);
    out.weight = share / (share + Mis::raise(light_step) * light_sum + Mis::raise(eye_step) * eye_sum);
    if (terms != nullptr) *terms = {0, light_step, light_reverse, eye_step, eye_reverse};
  }
  return true;
}

}  // namespace candela::transport
