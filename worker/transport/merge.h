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

  // Asks for what Gather::start reads of the memory, for an eye's vertex that connects.
  void announce(const Vertex& v) const {
    if (const PhotonMap* map = map_for(v)) map->announce(v.hit.p, radius_for(v));
  }
  // Null: nothing to merge with.
  const PhotonMap* map_for(const Vertex& v) const {
    if (v.edges >= max_edges) return nullptr;
    return v.kind == Vertex::Kind::surface ? surface : medium;
  }
  float radius_for(const Vertex& v) const {
    return v.kind == Vertex::Kind::surface ? disc_radius : ball_radius;
  }

  const PhotonMap* surface = nullptr;  // null: no merging there
  const PhotonMap* medium = nullptr;
  float disc_radius, ball_radius;
  DiscKernel disc;
  BallKernel ball;
  MergeFactors eta;               // raised; > 0 where there is a map
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

// The weighted contribution of a photon at the eye's vertex v, which connects, without v.throughput and
// maps.per_path.
template <class Heuristic>
class SurfaceMerge {
 public:
  SurfaceMerge(const MergeMaps& maps, const Vertex& v)
      : maps_(maps), v_(v), wo_(v.hit.shading.to_local(v.wo)), most_edges_(maps.max_edges - v.edges) {}

  void operator()(const Photon& photon, float d2) {
    if (photon.edges > most_edges_) return;
    const Vec3 wi = v_.hit.shading.to_local(photon.wo);
    float pdf = 0;
    Spectrum value = v_.closure.eval_pdf(wo_, wi, TransportMode::radiance, pdf);
    if (value.is_black()) return;
    value *= photon.flux;
    const float cosine = std::max(v_.density_factor(photon.wo), kLeastOfOwnCosine * photon.cosine());
    float factor = maps_.disc.value(d2) / cosine;
    if constexpr (Heuristic::kWeighs) {
      const auto reverse =
          static_cast<double>(v_.closure.pdf_solid_angle(wi, wo_, TransportMode::importance));
      factor *= static_cast<float>(merge_weight(
          maps_.eta.surface, sum_of<Heuristic>(photon.mis(), static_cast<double>(pdf), maps_.eta),
          sum_of<Heuristic>(v_.mis, reverse, maps_.eta)));
    }
    sum += value * factor;
  }

  Spectrum sum;

 private:
  const MergeMaps& maps_;
  const Vertex& v_;
  Vec3 wo_;
  std::uint32_t most_edges_;
};

template <class Heuristic>
class MediumMerge {
 public:
  MediumMerge(const scene::Scene& scene, const MergeMaps& maps, const Vertex& v)
      : maps_(maps), v_(v), phase_(scene.medium(v.medium).phase()), most_edges_(maps.max_edges - v.edges) {}

  void operator()(const Photon& photon, float d2) {
    if (photon.medium() != v_.medium || photon.edges > most_edges_) return;
    float factor = phase_.eval(v_.wo, photon.wo) * maps_.ball.value(d2);
    if (factor == 0) return;
    if constexpr (Heuristic::kWeighs) {
      const auto forward = static_cast<double>(phase_.pdf_solid_angle(v_.wo, photon.wo));
      const auto reverse = static_cast<double>(phase_.pdf_solid_angle(photon.wo, v_.wo));
      factor *= static_cast<float>(merge_weight(maps_.eta.medium,
                                                sum_of<Heuristic>(photon.mis(), forward, maps_.eta),
                                                sum_of<Heuristic>(v_.mis, reverse, maps_.eta)));
    }
    sum += photon.flux * factor;
  }

  Spectrum sum;

 private:
  const MergeMaps& maps_;
  const Vertex& v_;
  const scene::Phase& phase_;
  std::uint32_t most_edges_;
};

// All merges at one vertex of the eye after another, in steps between which photons come from memory:
// MergeMaps::announce() when the vertex is made, start() and collect() when there has been something else to
// do, finish() before the vertex goes. finish() does what is left of all.
template <class Heuristic>
class Gather {
 public:
  Gather(const scene::Scene& scene, const MergeMaps& maps) : scene_(scene), maps_(maps) {}

  // v connects. The one before has to be finished.
  void start(const Vertex& v) {
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
    if (v_->kind == Vertex::Kind::surface) {
      SurfaceMerge<Heuristic> merge(maps_, *v_);
      use(merge);
      sum_ += merge.sum;
    } else {
      MediumMerge<Heuristic> merge(scene_, maps_, *v_);
      use(merge);
      sum_ += merge.sum;
    }
  }

  const scene::Scene& scene_;
  const MergeMaps& maps_;
  const PhotonMap* map_ = nullptr;
  const Vertex* v_ = nullptr;
  Step step_ = Step::none;
  Spectrum sum_;
  PhotonMap::Query query_;
  PhotonMap::Hits hits_;
};

// The same in one step.
template <class Heuristic>
Spectrum merge(const scene::Scene& scene, const MergeMaps& maps, const Vertex& v) {
  Gather<Heuristic> gather(scene, maps);
  gather.start(v);
  return gather.finish();
}

}  // namespace candela::transport
