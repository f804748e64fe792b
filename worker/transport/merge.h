// Merging: an eye vertex with the photons around it, as if they had met [Hachisuka 2012] [Georgiev 2012]. A
// photon at distance d of an eye vertex on a surface adds
//   beta f(wo, w) |cos_s w| / |cos_g w| flux K_r(d) / light_path_count,
// w: where the photon's light came from. The flux per area is radiance times the cosine of the geometry; the
// bsdf wants that of the shading normal. Both are taken at the eye's vertex, so that on curved and cornered
// surfaces their quotient stays near 1 where the photon's own cosine may be anything. In a medium it adds
//   beta sigma_s p(wo, w) flux K_r(d) / light_path_count,
// beta having the sigma_s of the eye's vertex.
//
// The weight of a merge (mis.h) is eta / (eta + sum_light + sum_eye), each sum from its own subpath's lengths
// and directions: taken from an averaged place they would add a bias of first order in r, eta =
// light_path_count times effective area or volume.
#pragma once

#include <cstdint>

#include "worker/transport/kernels.h"
#include "worker/transport/photon_map.h"
#include "worker/transport/vertex.h"

namespace candela::transport {

// One iteration's photons and radii. Immutable while eye paths run.
struct MergeMaps {
  MergeMaps(Kernel kernel, float disc_radius_, float ball_radius_)
      : disc_radius(disc_radius_),
        ball_radius(ball_radius_),
        disc(kernel, disc_radius_),
        ball(kernel, ball_radius_) {}

  const PhotonMap* surface = nullptr;  // null: no merging there
  const PhotonMap* medium = nullptr;
  float disc_radius, ball_radius;
  DiscKernel disc;
  BallKernel ball;
  MergeFactors eta;               // raised; > 0 where there is a map
  float per_path = 1;             // 1 / light_path_count
  std::uint32_t max_edges = ~0u;  // of the merged path
};

// The weight. eta > 0.
inline double merge_weight(double eta, double light_sum, double eye_sum) {
  return 1 / (1 + (light_sum + eye_sum) / eta);
}

// What all photons around the eye's vertex v, which connects, add to its path: weighted, v.throughput
// included.
template <class Heuristic>
Spectrum merge(const scene::Scene& scene, const MergeMaps& maps, const Vertex& v) {
  const bool surface = v.kind == Vertex::Kind::surface;
  const PhotonMap* map = surface ? maps.surface : maps.medium;
  if (map == nullptr || v.edges >= maps.max_edges) return {};
  const std::uint32_t most_edges = maps.max_edges - v.edges;
  Spectrum sum;
  if (surface) {
    const Vec3 wo = v.hit.shading.to_local(v.wo);
    map->visit(v.hit.p, maps.disc_radius, [&](const Photon& photon, float d2) {
      if (photon.edges > most_edges) return;
      const Vec3 wi = v.hit.shading.to_local(photon.wo);
      float pdf = 0;
      Spectrum value = v.closure.eval_pdf(wo, wi, TransportMode::radiance, pdf);
      if (value.is_black()) return;
      value *= photon.flux;
      float factor = maps.disc.value(d2) / v.density_factor(photon.wo);
      if constexpr (Heuristic::kWeighs) {
        const auto reverse =
            static_cast<double>(v.closure.pdf_solid_angle(wi, wo, TransportMode::importance));
        factor *= static_cast<float>(merge_weight(
            maps.eta.surface, sum_of<Heuristic>(photon.mis(), static_cast<double>(pdf), maps.eta),
            sum_of<Heuristic>(v.mis, reverse, maps.eta)));
      }
      sum += value * factor;
    });
  } else {
    const scene::Phase& phase = scene.medium(v.medium).phase();
    map->visit(v.hit.p, maps.ball_radius, [&](const Photon& photon, float d2) {
      if (photon.medium != v.medium || photon.edges > most_edges) return;
      float factor = phase.eval(v.wo, photon.wo) * maps.ball.value(d2);
      if (factor == 0) return;
      if constexpr (Heuristic::kWeighs) {
        const auto forward = static_cast<double>(phase.pdf_solid_angle(v.wo, photon.wo));
        const auto reverse = static_cast<double>(phase.pdf_solid_angle(photon.wo, v.wo));
        factor *= static_cast<float>(merge_weight(maps.eta.medium,
                                                  sum_of<Heuristic>(photon.mis(), forward, maps.eta),
                                                  sum_of<Heuristic>(v.mis, reverse, maps.eta)));
      }
      sum += photon.flux * factor;
    });
  }
  return v.throughput * sum * maps.per_path;
}

}  // namespace candela::transport
