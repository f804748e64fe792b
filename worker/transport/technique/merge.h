// Merging: an eye vertex with the photons around it, as if they had met [Hachisuka 2012] [Georgiev 2012]. A
// photon at distance d of an eye vertex on a surface adds
//   beta f(wo, w) |cos_s w| / |cos_g w| flux K_r(d) / light_path_count,
// w: where the photon's light came from. The flux per area is radiance times the cosine of the geometry; the
// bsdf wants that of the shading normal. Both are taken at the eye's vertex, so that on curved and cornered
// surfaces their quotient stays near 1 where the photon's own cosine may be anything, but see
// kMinOfOwnCosine. In a medium it adds
//   beta sigma_s p(wo, w) flux K_r(d) / light_path_count,
// beta having the sigma_s of the eye's vertex.
//
// The weight of a merge (mis/balance_power.h) is eta / (eta + sum_light + sum_eye), each sum from its own
// subpath's lengths and directions: taken from an averaged place they would add a bias of first order in r,
// eta = light_path_count times effective area or volume.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

#include "worker/transport/merge_scale.h"
#include "worker/transport/photon_map.h"
#include "worker/transport/scattering.h"
#include "worker/transport/statistics/none.h"
#include "worker/transport/technique/merge_edits.h"
#include "worker/transport/technique/merge_letters.h"
#include "worker/transport/vertex.h"

namespace candela::transport {

// One iteration's photons. Immutable while eye paths run. Block: that of the photons.
template <class Block>
struct MergeMaps {
  // Null: nothing to merge with.
  const PhotonMap<Block>* map_for(const ScatterPoint& v) const {
    if (v.edges >= max_edges) return nullptr;
    return v.on_surface() ? surface : medium;
  }

  const PhotonMap<Block>* surface = nullptr;  // null: no merging there
  const PhotonMap<Block>* medium = nullptr;
  float per_path = 1;             // 1 / light_path_count
  std::uint32_t max_edges = ~0u;  // of the merged path
  // Photons in directions of a higher density are left to the eye's walk, which finds their paths alone.
  // Photons of a light that it cannot meet are merged.
  float max_density = std::numeric_limits<float>::infinity();
  bool leaves(const Photon<Block>& photon, float pdf_solid_angle) const {
    return pdf_solid_angle > max_density && photon.lit_by_delta == 0;
  }
};

// The cosine that is divided by is at least this share of the photon's own. On one face the two are equal,
// and photons get few as the cosine goes to 0. A photon of another face may graze the eye's and be one of
// many: over edges of coarse meshes with smooth normals the quotient would make bright lines and fireflies.
inline constexpr float kMinOfOwnCosine = 0.5f;

// The weight. eta > 0.
inline double merge_weight(double eta, double light_sum, double eye_sum) {
  return 1 / (1 + (light_sum + eye_sum) / eta);
}

// As RangeSearch compares.
inline bool within(float d2, float radius) {
  return d2 <= std::min(radius * radius, std::numeric_limits<float>::max());
}

// The weighted contribution of a photon at the eye's vertex v, which is connectible, without v.throughput and
// maps.per_path. scale: at the film position of the eye's path; its eta is > 0 if weights are wanted.
template <class Mis, class Block, class Statistics, bool kLetters, class Edits = NoMergeEdits>
class SurfaceMerge {
 public:
  SurfaceMerge(const MergeMaps<Block>& maps, const MergeScale& scale, const Vertex<Block>& v,
               Statistics& statistics, MergeLetters& letters, const Edits& edits = {})
      : maps_(maps),
        scale_(scale),
        v_(v),
        statistics_(statistics),
        letters_(letters),
        edits_(edits),
        scattering_(v.hit, v.closure, v.wo),
        max_edges_(maps.max_edges - v.edges) {}

  void operator()(const Photon<Block>& photon, float d2) {
    if (photon.edges > max_edges_) return;
    const SurfaceScattering::Direction wi = scattering_.along(photon.wo);
    float pdf = 0;
    if constexpr (Edits::kEdits) edits_.meet(v_, maps_.surface->number(photon));
    Spectrum value = scattering_.value(wi, TransportMode::radiance, pdf);
    if (value.is_black() || maps_.leaves(photon, pdf)) return;
    value *= photon.flux;
    if constexpr (Edits::kEdits) value *= edits_.share(v_.hit.shading.to_local(v_.wo), wi.local);
    const float cosine = std::max(v_.density_factor(photon.wo), kMinOfOwnCosine * photon.cosine());
    float kernel = scale_.disc.value(d2);
    if constexpr (Statistics::kReaches) kernel = within(d2, scale_.disc_radius) ? kernel : 0;
    float factor = kernel / cosine;
    float weight = 1;
    if constexpr (Mis::kWeighs) {
      const auto reverse =
          static_cast<double>(scattering_.pdf_reverse_solid_angle(wi, TransportMode::radiance));
      weight = static_cast<float>(merge_weight(
          scale_.eta.surface, Mis::sum(photon.weights.block(), static_cast<double>(pdf), scale_.eta),
          Mis::sum(v_.mis, reverse, scale_.eta)));
      factor *= weight;
    }
    sum += value * factor;
    if (d2 <= scale_.inner_disc2) inner += value * (scale_.inner_disc.value(d2) / cosine * weight);
    if constexpr (kLetters) letters_.add(v_, photon.wo, maps_.surface->states(photon), value * factor);
    if constexpr (Statistics::kCollects)
      statistics_.add(maps_.surface->position(photon) - v_.hit.p, value, weight / cosine, kernel);
  }

  Spectrum sum;
  Spectrum inner;  // the same within half of the radius, with its kernel

 private:
  const MergeMaps<Block>& maps_;
  const MergeScale& scale_;
  const Vertex<Block>& v_;
  Statistics& statistics_;
  [[maybe_unused]] MergeLetters& letters_;
  [[no_unique_address]] Edits edits_;
  SurfaceScattering scattering_;
  std::uint32_t max_edges_;
};

template <class Mis, class Block, class Statistics, bool kLetters, class Edits = NoMergeEdits>
class MediumMerge {
 public:
  MediumMerge(const scene::Scene& scene, const MergeMaps<Block>& maps, const MergeScale& scale,
              const Vertex<Block>& v, Statistics& statistics, MergeLetters& letters, const Edits& edits = {})
      : maps_(maps),
        scale_(scale),
        v_(v),
        statistics_(statistics),
        letters_(letters),
        edits_(edits),
        scattering_(scene.medium(v.medium).phase(), v.wo),
        max_edges_(maps.max_edges - v.edges) {}

  void operator()(const Photon<Block>& photon, float d2) {
    if (photon.medium() != v_.medium || photon.edges > max_edges_) return;
    if (v_.turned) [[unlikely]]
      return merge_turned(photon, d2);
    const float phase = scattering_.value(photon.wo);
    if (maps_.leaves(photon, phase)) return;  // the phase function is its density
    float kernel = scale_.ball.value(d2);
    if constexpr (Statistics::kReaches) kernel = within(d2, scale_.ball_radius) ? kernel : 0;
    float factor = phase * kernel;
    if (Statistics::kReaches ? phase == 0 : factor == 0) return;
    decltype(auto) flux = flux_of(photon);
    float weight = 1;
    if constexpr (Mis::kWeighs) {
      const auto forward = static_cast<double>(scattering_.pdf_solid_angle(photon.wo));
      const auto reverse = static_cast<double>(scattering_.pdf_reverse_solid_angle(photon.wo));
      weight = static_cast<float>(merge_weight(scale_.eta.medium,
                                               Mis::sum(photon.weights.block(), forward, scale_.eta),
                                               Mis::sum(v_.mis, reverse, scale_.eta)));
      factor *= weight;
    }
    sum += flux * factor;
    if (d2 <= scale_.inner_ball2) inner += flux * (phase * scale_.inner_ball.value(d2) * weight);
    if constexpr (kLetters) letters_.add(v_, photon.wo, maps_.medium->states(photon), flux * factor);
    if constexpr (Statistics::kCollects)
      statistics_.add(maps_.medium->position(photon) - v_.hit.p, flux, phase * weight, kernel);
  }

  Spectrum sum;
  Spectrum inner;  // the same within half of the radius, with its kernel

 private:
  // The same at a place whose light edits turn.
  [[gnu::noinline]] void merge_turned(const Photon<Block>& photon, float d2) {
    const TurnedScattering scattering(v_.closure, v_.wo);
    const Spectrum flux = flux_of(photon);  // which tells the closure the photon's state
    float pdf = 0;
    const Spectrum value = scattering.value(photon.wo, TransportMode::radiance, pdf) * flux;
    if (value.is_black() || maps_.leaves(photon, pdf)) return;
    float kernel = scale_.ball.value(d2);
    if constexpr (Statistics::kReaches) kernel = within(d2, scale_.ball_radius) ? kernel : 0;
    float weight = 1;
    if constexpr (Mis::kWeighs) {
      const auto reverse =
          static_cast<double>(scattering.pdf_reverse_solid_angle(photon.wo, TransportMode::radiance));
      weight = static_cast<float>(merge_weight(
          scale_.eta.medium, Mis::sum(photon.weights.block(), static_cast<double>(pdf), scale_.eta),
          Mis::sum(v_.mis, reverse, scale_.eta)));
    }
    const Spectrum found = value * (weight * kernel);
    sum += found;
    if (d2 <= scale_.inner_ball2) inner += value * (weight * scale_.inner_ball.value(d2));
    if constexpr (kLetters) letters_.add(v_, photon.wo, maps_.medium->states(photon), found);
    if constexpr (Statistics::kCollects)
      statistics_.add(maps_.medium->position(photon) - v_.hit.p, value, weight, kernel);
  }
  decltype(auto) flux_of(const Photon<Block>& photon) {
    if constexpr (Edits::kEdits) {
      edits_.meet(v_, maps_.medium->number(photon));
      return photon.flux * edits_.medium_share();
    } else {
      return (photon.flux);
    }
  }

  const MergeMaps<Block>& maps_;
  const MergeScale& scale_;
  const Vertex<Block>& v_;
  Statistics& statistics_;
  [[maybe_unused]] MergeLetters& letters_;
  [[no_unique_address]] Edits edits_;
  MediumScattering scattering_;
  std::uint32_t max_edges_;
};

// All merges at one vertex of the eye after another, in steps between which photons come from memory:
// prefetch() when the vertex is made, start() and collect() when there has been something else to
// do, finish() before the vertex goes. finish() does what is left of all.
//
// StatisticsT: what else is wanted of merges (statistics/none.h). kLetters: labels may be wanted. Edits:
// MergeEdits, whose start() comes before that of the vertex.
template <class Mis, class StatisticsT = NoStatistics, class Block = typename Mis::Block,
          bool kLetters = false, class Edits = NoMergeEdits>
class Gather {
 public:
  using Statistics = StatisticsT;
  Gather(const scene::Scene& scene, const MergeMaps<Block>& maps, const Statistics& statistics = {},
         EyeLetters* letters = nullptr, const Edits& edits = {})
      : scene_(scene), maps_(maps), statistics_(statistics), letters_(letters), edits_(edits) {}

  // A path is next, of this place on the film, with this scale, which has to outlive it.
  void begin(const MergeScale& scale, FilmPosition at = {}) {
    scale_ = &scale;
    inner_of_path_ = {};
    if constexpr (requires(Statistics s) { s.place(at); }) statistics_.place(at);
    if constexpr (Statistics::kCollects) statistics_.begin();
  }
  // Statistics of the path, up to the last vertex that is finished.
  const Statistics& statistics() const { return statistics_; }
  // As the sum of what finish() has returned for the path, by the photons within half of the radius; where
  // the scale wants it.
  Spectrum inner() const { return inner_of_path_; }

  // Asks for what start() reads of the memory, for an eye's vertex that is connectible.
  void prefetch(const ScatterPoint& v) const {
    if (const PhotonMap<Block>* map = maps_.map_for(v)) map->prefetch(v.hit.p, radius_for(v));
  }
  // Its state for edits. The vertex before has to be finished.
  Edits& edits() { return edits_; }
  // v is connectible. The one before has to be finished.
  void start(const Vertex<Block>& v) {
    map_ = maps_.map_for(v);
    if (map_ == nullptr) return;
    v_ = &v;
    map_->find(v.hit.p, radius_for(v), query_);
    if constexpr (Statistics::kCollects) statistics_.start(v, *scale_, maps_.per_path);
    if constexpr (kLetters) letters_.start();
    step_ = Step::found;
  }
  void collect() {
    if (step_ != Step::found) return;
    sum_ = inner_ = {};
    with_merge([&](auto&& merge) { map_->collect(query_, hits_, merge); });
    step_ = Step::collected;
  }
  // Adds to the path's sum what all photons around the vertex bring it, and returns that: weighted,
  // v.throughput included.
  Spectrum finish(Spectrum& path_sum) {
    collect();
    if (step_ != Step::collected) return {};
    step_ = Step::none;
    if (hits_.count > 0)
      with_merge([&](auto&& merge) {
        for (std::uint32_t i = 0; i < hits_.count; ++i) merge(*hits_.hit[i].photon, hits_.hit[i].d2);
      });
    if constexpr (Statistics::kCollects) statistics_.end();
    const Spectrum found = v_->throughput * sum_ * maps_.per_path;
    inner_of_path_ += v_->throughput * inner_ * maps_.per_path;
    if constexpr (kLetters)
      letters_.finish(found, path_sum, v_->throughput * maps_.per_path);
    else
      path_sum += found;
    return found;
  }

 private:
  enum class Step : std::uint8_t { none, found, collected };
  // Radius of the search.
  float radius_for(const ScatterPoint& v) const {
    const float radius = v.on_surface() ? scale_->disc_radius : scale_->ball_radius;
    if constexpr (Statistics::kReaches) return std::max(radius, statistics_.reach(v.on_surface()));
    return radius;
  }
  template <class Use>
  void with_merge(const Use& use) {
    if constexpr (kLetters) {
      if (letters_.any()) return with_merge_of<true>(use);
    }
    with_merge_of<false>(use);
  }
  template <bool kLabels, class Use>
  void with_merge_of(const Use& use) {
    if (v_->on_surface()) {
      SurfaceMerge<Mis, Block, Statistics, kLabels, Edits> merge(maps_, *scale_, *v_, statistics_, letters_,
                                                                 edits_);
      use(merge);
      sum_ += merge.sum;
      inner_ += merge.inner;
    } else {
      MediumMerge<Mis, Block, Statistics, kLabels, Edits> merge(scene_, maps_, *scale_, *v_, statistics_,
                                                                letters_, edits_);
      use(merge);
      sum_ += merge.sum;
      inner_ += merge.inner;
    }
  }

  const scene::Scene& scene_;
  const MergeMaps<Block>& maps_;
  [[no_unique_address]] Statistics statistics_;
  MergeLetters letters_;
  [[no_unique_address]] Edits edits_;
  const MergeScale* scale_ = nullptr;  // of the path
  const PhotonMap<Block>* map_ = nullptr;
  const Vertex<Block>* v_ = nullptr;
  Step step_ = Step::none;
  Spectrum sum_, inner_;  // of the vertex
  Spectrum inner_of_path_;
  typename PhotonMap<Block>::Query query_;
  typename PhotonMap<Block>::Hits hits_;
};

// The same in one step.
template <class Mis, class Block>
Spectrum merge(const scene::Scene& scene, const MergeMaps<Block>& maps, const MergeScale& scale,
               const Vertex<Block>& v) {
  Gather<Mis, NoStatistics, Block> gather(scene, maps);
  gather.begin(scale);
  gather.start(v);
  Spectrum sum;
  return gather.finish(sum);
}

}  // namespace candela::transport
