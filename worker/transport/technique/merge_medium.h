// Merging in media with points and beams [Krivanek 2014]: light's entity first, the eye's second. With w the
// direction the light came from and N light paths (those that leave beams, for beams),
//   P-P3D  beta sigma_s p(wo, w) flux K_3 / N                a vertex with the photons around it
//   P-B2D  beta(t) sigma_s p(wo, w) flux K_2 / N             a query beam with the photons beside it
//   B-P2D  beta sigma_s p(wo, w) flux(s) K_2 / N             a vertex with the photon beams that pass it
//   B-B1D  beta(t) sigma_s p(wo, w) flux(s) K_1 / (N sin)    two beams that pass each other
// beta(t), flux(s): times T / P, of long beams times T, see photon_beams.h. sigma_s and p: where the eye's
// subpath has the vertex. The merged vertex has light's and the eye's subpath meet in one medium. Weights:
// eta of the technique over all eta at the vertex and the sums of both sides, each from its own subpath's
// lengths and its own place's hazard (mis/beam_balance.h).
#pragma once

#include <cstdint>
#include <span>

#include "worker/transport/kernels.h"
#include "worker/transport/photon_beams.h"
#include "worker/transport/photon_points.h"
#include "worker/transport/technique/merge_letters.h"

namespace candela::transport {

struct MediumRadii {
  double point_point = 0, point_beam = 0, beam_point = 0, beam_beam = 0;
};

// Radii and kernels of the merges in one medium.
struct MediumKernels {
  MediumKernels(Kernel kernel, const MediumRadii& radii_)
      : radii(radii_),
        ball(kernel, static_cast<float>(radii.point_point)),
        point_beam(kernel, static_cast<float>(radii.point_beam)),
        beam_point(kernel, static_cast<float>(radii.beam_point)),
        beam_beam(kernel, static_cast<float>(radii.beam_beam)) {}

  MediumRadii radii;
  BallKernel ball;
  DiscKernel point_beam, beam_point;
  LineKernel beam_beam;
};

// A sum for each merge in media.
template <class T>
struct ByMerge {
  T point_point{}, point_beam{}, beam_point{}, beam_beam{};
};
using MediumShares = ByMerge<Spectrum>;

// Counts of the work of merging, the same on every machine.
struct MergeWork {
  ByMerge<std::uint64_t> queries, nodes, merges;  // nodes: of trees that queries looked into; P-P3D has none

  void add(const MergeWork& other);
};

// One iteration's merges in media. Immutable while eye paths run.
struct MediumMaps {
  const PhotonPoints* points = nullptr;  // null: none
  const PhotonBeams* beams = nullptr;
  std::span<const MediumKernels> kernels;  // by the number of the medium
  MisFactors factors;                      // of the walks
  float per_path = 1;                      // 1 / light_path_count
  float paths_per_beam_path = 1;           // light paths for each that leaves beams
  std::uint32_t max_edges = ~0u;           // of the merged path
};

// The merges of one eye path after another.
class MediumGather {
 public:
  // letters: of the eye paths; null: nobody asks.
  MediumGather(const scene::Scene& scene, const MediumMaps& maps, EyeLetters* letters = nullptr)
      : scene_(scene), maps_(maps), at_points_(letters), at_edge_(letters) {}

  // A path is next. eta: the one that all other weights of the path take.
  void begin(const MergeFactors& eta) { eta_ = eta; }
  // P-P3D at an eye's vertex that is connectible, in steps: prefetch() when the vertex is made, start() after
  // other work, finish() before the vertex goes. Results are weighted, v.throughput included, and added to
  // the path's sum.
  void prefetch(const Vertex<MisBlock>& v) const;
  void start(const Vertex<MisBlock>& v);
  Spectrum finish(Spectrum& path_sum);
  // B-P2D at such a vertex.
  Spectrum beams_at(const Vertex<MisBlock>& v, Spectrum& path_sum);
  // Along a query beam: P-B2D and B-B1D. start: of its edge. Adds to shares.
  void along(const Crossing& crossing, const EdgeStart& start, MediumShares& shares, Spectrum& path_sum);
  // The work of all paths so far.
  const MergeWork& work() const { return work_; }

 private:
  // Light's copy of a merged vertex.
  struct LightCopy {
    double hazard;
    double survival;  // of the edge by which light's subpath arrives
    double sum;       // of all techniques with fewer vertices from the light than the merge, relative to it
  };
  LightCopy light_copy(const PhotonBeam& beam, double s, const scene::Medium& medium, double survival,
                       double pdf_to_light) const;
  LightCopy light_copy(const Photon<MisBlock>& photon, double eye_hazard, bool hazards_differ,
                       double pdf_to_light) const;

  bool wants_points(const Vertex<MisBlock>& v) const {
    return !v.on_surface() && v.edges < maps_.max_edges && maps_.factors.medium[v.medium].point_point > 0;
  }
  double weight_at(const Vertex<MisBlock>& v, double own, const LightCopy& light, Vec3 w) const;

  const scene::Scene& scene_;
  const MediumMaps& maps_;
  MergeWork work_;
  MergeFactors eta_;                     // of the path
  const Vertex<MisBlock>* v_ = nullptr;  // started
  RangeSearch::Query query_;
  // Labels of P-P3D, which ends late, and of the other merges.
  MergeLetters at_points_, at_edge_;
};

}  // namespace candela::transport
