// Merging: an eye vertex with the photons around it, as if they had met [Hachisuka 2012] [Georgiev 2012]. A
// photon at distance d of an eye vertex on a surface adds
//   beta f(wo, w) |cos_s w| / |cos_g w| flux K_r(d) / light_path_count,
// w: where the photon's light came from. The flux per area is radiance times the cosine of the geometry; the
// bsdf wants that of the shading normal. Both are taken at the eye's vertex, so that on curved and cornered
// surfaces their quotient stays near 1 where the photon's own cosine may be anything, but see
// kLeastOfOwnCosine. In a medium it adds
//   beta sigma_s p(wo, w) flux K_r(d) / light_path_count,
// beta having the sigma_s of the eye's vertex.
//
// The weight of a merge (mis/balance_power.h) is eta / (eta + sum_light + sum_eye), each sum from its own
// subpath's lengths and directions: taken from an averaged place they would add a bias of first order in r,
// eta = light_path_count times effective area or volume.
#pragma once

#include <cstdint>

#include "worker/transport/kernels.h"
#include "worker/transport/photon_map.h"
#include "worker/transport/vertex.h"

namespace candela::transport {

// One iteration's photons and radii. Immutable while eye paths run. Block: that of the photons.
template <class Block>
struct MergeMaps {
  MergeMaps(Kernel kernel, float disc_radius_, float ball_radius_)
      : disc_radius(disc_radius_),
        ball_radius(ball_radius_),
        disc(kernel, disc_radius_),
        ball(kernel, ball_radius_) {}

  // Asks for what Gather::start reads of the memory, for an eye's vertex that is connectible.
  void announce(const ScatterPoint& v) const {
    if (const PhotonMap<Block>* map = map_for(v)) map->announce(v.hit.p, radius_for(v));
  }
  // Null: nothing to merge with.
  const PhotonMap<Block>* map_for(const ScatterPoint& v) const {
    if (v.edges >= max_edges) return nullptr;
    return v.on_surface() ? surface : medium;
  }
  float radius_for(const ScatterPoint& v) const { return v.on_surface() ? disc_radius : ball_radius; }

  const PhotonMap<Block>* surface = nullptr;  // null: no merging there
  const PhotonMap<Block>* medium = nullptr;
  float disc_radius, ball_radius;
  DiscKernel disc;
  BallKernel ball;
  float per_path = 1;             // 1 / light_path_count
  std::uint32_t max_edges = ~0u;  // of the merged path
};

// The cosine that is divided by is at least this share of the photon's own. On one face the two are equal,
// and photons get few as the cosine goes to 0. A photon of another face may graze the eye's and be one of
// many: over edges of coarse meshes with smooth normals the quotient would make bright lines and fireflies.
inline constexpr float kLeastOfOwnCosine = 0.5f;

// The weight. eta > 0.
inline double merge_weight(double eta, double light_sum, double eye_sum) {
  return 1 / (1 + (light_sum + eye_sum) / eta);
}

// The weighted contribution of a photon at the eye's vertex v, which is connectible, without v.throughput and
// maps.per_path. eta: at the film position of the eye's path, > 0 if weights are wanted.
template <class Mis, class Block>
class SurfaceMerge {
 public:
  SurfaceMerge(const MergeMaps<Block>& maps, const MergeFactors& eta, const Vertex<Block>& v)
      : maps_(maps),
        eta_(eta),
        v_(v),
        wo_(v.hit.shading.to_local(v.wo)),
        max_edges_(maps.max_edges - v.edges) {}

  void operator()(const Photon<Block>& photon, float d2) {
    if (photon.edges > max_edges_) return;
    const Vec3 wi = v_.hit.shading.to_local(photon.wo);
    float pdf = 0;
    Spectrum value = v_.closure.eval_pdf(wo_, wi, TransportMode::radiance, pdf);
    if (value.is_black()) return;
    value *= photon.flux;
    const float cosine = std::max(v_.density_factor(photon.wo), kLeastOfOwnCosine * photon.cosine());
    float factor = maps_.disc.value(d2) / cosine;
    if constexpr (Mis::kWeighs) {
      const auto reverse =
          static_cast<double>(v_.closure.pdf_solid_angle(wi, wo_, TransportMode::importance));
      factor *= static_cast<float>(
          merge_weight(eta_.surface, Mis::sum(photon.weights.block(), static_cast<double>(pdf), eta_),
                       Mis::sum(v_.mis, reverse, eta_)));
    }
    sum += value * factor;
  }

  Spectrum sum;

 private:
  const MergeMaps<Block>& maps_;
  const MergeFactors& eta_;
  const Vertex<Block>& v_;
  Vec3 wo_;
  std::uint32_t max_edges_;
};

template <class Mis, class Block>
class MediumMerge {
 public:
  MediumMerge(const scene::Scene& scene, const MergeMaps<Block>& maps, const MergeFactors& eta,
              const Vertex<Block>& v)
      : maps_(maps),
        eta_(eta),
        v_(v),
        phase_(scene.medium(v.medium).phase()),
        max_edges_(maps.max_edges - v.edges) {}

  void operator()(const Photon<Block>& photon, float d2) {
    if (photon.medium() != v_.medium || photon.edges > max_edges_) return;
    float factor = phase_.eval(v_.wo, photon.wo) * maps_.ball.value(d2);
    if (factor == 0) return;
    if constexpr (Mis::kWeighs) {
      const auto forward = static_cast<double>(phase_.pdf_solid_angle(v_.wo, photon.wo));
      const auto reverse = static_cast<double>(phase_.pdf_solid_angle(photon.wo, v_.wo));
      factor *= static_cast<float>(merge_weight(eta_.medium, Mis::sum(photon.weights.block(), forward, eta_),
                                                Mis::sum(v_.mis, reverse, eta_)));
    }
    sum += photon.flux * factor;
  }

  Spectrum sum;

 private:
  const MergeMaps<Block>& maps_;
  const MergeFactors& eta_;
  const Vertex<Block>& v_;
  const scene::Phase& phase_;
  std::uint32_t max_edges_;
};

// All merges at one vertex of the eye after another, in steps between which photons come from memory:
// MergeMaps::announce() when the vertex is made, start() and collect() when there has been something else to
// do, finish() before the vertex goes. finish() does what is left of all.
template <class Mis, class Block = typename Mis::Block>
class Gather {
 public:
  Gather(const scene::Scene& scene, const MergeMaps<Block>& maps) : scene_(scene), maps_(maps) {}

  // A path is next, with this eta.
  void begin(const MergeFactors& eta) { eta_ = eta; }

  // v is connectible. The one before has to be finished.
  void start(const Vertex<Block>& v) {
    map_ = maps_.map_for(v);
    if (map_ == nullptr) return;
    v_ = &v;
    map_->find(v.hit.p, maps_.radius_for(v), query_);
    step_ = Step::found;
  }
  void collect() {
    if (step_ != Step::found) return;
    sum_ = {};
    with_merge([&](auto&& merge) { map_->collect(query_, hits_, merge); });
    step_ = Step::collected;
  }
  // What all photons around the vertex add to its path: weighted, v.throughput included.
  Spectrum finish() {
    collect();
    if (step_ != Step::collected) return {};
    step_ = Step::none;
    if (hits_.count > 0)
      with_merge([&](auto&& merge) {
        for (std::uint32_t i = 0; i < hits_.count; ++i) merge(*hits_.hit[i].photon, hits_.hit[i].d2);
      });
    return v_->throughput * sum_ * maps_.per_path;
  }

 private:
  enum class Step : std::uint8_t { none, found, collected };
  template <class Use>
  void with_merge(const Use& use) {
    if (v_->on_surface()) {
      SurfaceMerge<Mis, Block> merge(maps_, eta_, *v_);
      use(merge);
      sum_ += merge.sum;
    } else {
      MediumMerge<Mis, Block> merge(scene_, maps_, eta_, *v_);
      use(merge);
      sum_ += merge.sum;
    }
  }

  const scene::Scene& scene_;
  const MergeMaps<Block>& maps_;
  MergeFactors eta_;
  const PhotonMap<Block>* map_ = nullptr;
  const Vertex<Block>* v_ = nullptr;
  Step step_ = Step::none;
  Spectrum sum_;
  typename PhotonMap<Block>::Query query_;
  typename PhotonMap<Block>::Hits hits_;
};

// The same in one step.
template <class Mis, class Block>
Spectrum merge(const scene::Scene& scene, const MergeMaps<Block>& maps, const MergeFactors& eta,
               const Vertex<Block>& v) {
  Gather<Mis, Block> gather(scene, maps);
  gather.begin(eta);
  gather.start(v);
  return gather.finish();
}

}  // namespace candela::transport
