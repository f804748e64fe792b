// Contribution and densities of one whole path, by the literal formulas: slow, in double, and apart from the
// recursions of mis/, walk.h and technique/, which are tested against them (reference/).
//
// Vertices are a position with its surface or medium; bsdfs are prepared anew, from the side each walk comes
// from; what lies between vertices is found by rays of its own.
//
// Conventions that any set of weights is free to choose, and that have to be the same everywhere:
// - Delta lobes: both densities are per solid angle towards the light, times one delta function that is left
//   out: of the eye's walk prob, of the light's prob n_eye^2 cos_eye / (n_light^2 cos_light), as Snell's law
//   has it [Veach 1997, Eq. 5.3]. Weights take the cosines from the geometric normal, since they then cancel
//   in the walks; the value of an estimator needs the shading normal's.
// - Media: weights count the survival of an edge and the hazard at its end by the mean over channels;
//   survival of a grid is 1. Roulette and surfaces passed straight are in no weight.
// - hit_lens does not count the survival of the last edge.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "worker/transport/path/full_path.h"

namespace candela::transport::path {

class Evaluation;

// The evaluation of another path of the same scene by the same rules, and the numbers of vertices, from the
// light's end and from the sensor's, that are the same in both paths.
struct SharedEnds {
  const Evaluation* of = nullptr;  // null: none. It is valid
  std::size_t light = 0, sensor = 0;
};

enum class Wanted : std::uint8_t {
  all,
  if_lit  // a path whose ends and vertices pass no light is not followed, and counts as not valid
};

// Everything about a path in its scene.
class Evaluation {
 public:
  // valid() is false where the path cannot be followed: a ray between two vertices does not arrive.
  // shared: parts that follow from shared vertices alone are copied; the numbers are the same to the bit.
  Evaluation(const scene::Scene& scene, const FullPath& path, const Rules& rules,
             const SharedEnds& shared = {}, Wanted wanted = Wanted::all);
  bool valid() const { return valid_; }
  // Media found going from the light and from the eye are the same, and those of vertices in them.
  bool media_agree() const { return media_agree_; }
  // No medium on the way is a grid: the contribution has a closed form.
  bool closed_form() const { return closed_form_; }
  // The relative error that floats may give the path's densities and contribution, as far as it is known:
  // cosines that vanish, and stretches of media, which walks take to end short of surfaces by their error.
  // Not counted: lobes as narrow as the last bits of a direction.
  double rounding() const;
  const PathNumbers& numbers() const { return numbers_; }
  // The medium through which a walk from the light (the eye) comes to x_v, which is not its first vertex.
  std::uint32_t medium_arriving(bool from_light, std::size_t v) const {
    const Stretches& all = edges_[from_light ? v - 1 : v].stretches;
    return all[from_light ? all.size() - 1 : 0].medium;
  }

  // The measurement contribution f(x), per channel: emitted radiance, geometric terms, transmittance, bsdfs
  // as radiance has them (towards the light x_{i-1}, with the shading normal's cosine there), importance.
  std::array<Scaled, 3> contribution() const;
  // contribution() in doubles, to the bit.
  std::array<double, 3> contribution_values() const;
  // Contribution of a technique that makes this path: f over the density with which it truly does, that of
  // flights and straight passes included; without roulette, and without a merge's kernel.
  std::array<double, 3> estimator_value(const Technique& technique) const;
  // The true density, per area, of a walk from the light (the eye) that was at the vertex before x_v coming
  // to x_v: flights have the density of a walk that carries white, surfaces passed straight have theirs,
  // delta functions are left out as contribution() leaves them out. x_v is not the walk's first vertex.
  Scaled step_density(bool from_light, std::size_t v) const;
  // step_density() in a double; 0: a double cannot hold it.
  double held_step_density(bool from_light, std::size_t v) const;
  // The probability with which such a walk stays at x_v, on a surface, and does not pass it straight.
  double prob_stay(bool from_light, std::size_t v) const;

 private:
  // Parts of an edge, from the light to the eye: stretches of one medium, and surfaces passed between them.
  struct Stretch {
    std::uint32_t medium = scene::kNone;
    double length = 0;
  };
  struct Pass {
    scene::SurfaceHit hit;
    std::array<double, 3> fraction{};
    double prob_from_light = 1, prob_from_eye = 1;
  };
  // Most edges have one stretch, which needs no memory of its own.
  class Stretches {
   public:
    std::size_t size() const { return size_; }
    Stretch& operator[](std::size_t i) { return i == 0 ? first_ : more_[i - 1]; }
    const Stretch& operator[](std::size_t i) const { return i == 0 ? first_ : more_[i - 1]; }
    void push_back(const Stretch& stretch) {
      if (size_ == 0)
        first_ = stretch;
      else
        more_.push_back(stretch);
      ++size_;
    }

   private:
    Stretch first_;
    std::vector<Stretch> more_;
    std::size_t size_ = 0;
  };
  struct Edge {
    Stretches stretches;
    std::vector<Pass> passes;
    // Nothing is on the way.
    bool is_plain() const { return stretches.size() == 1 && stretches[0].medium == scene::kNone; }
  };
  struct Inner {
    std::array<double, 3> value{};              // rho_i
    double prob_to_eye = 0, prob_to_light = 0;  // true densities of the directions
    bool scatters_through = false;              // as the eye's walk sees the bsdf
  };

  bool follow_edge(std::size_t i);
  void assign_media();
  void evaluate_inner(std::size_t i);
  // False: nothing is edited there.
  bool evaluate_turned(std::size_t i, const scene::Medium& medium, Vec3 to_light, Vec3 to_eye);
  void evaluate_delta(std::size_t i, const scene::Closure& from_light, const scene::Closure& from_eye,
                      Vec3 to_light, Vec3 to_eye);
  void evaluate_cone(std::size_t i, const scene::Closure& from_light, const scene::Closure& from_eye);
  void evaluate_light();
  void evaluate_light_direct();
  bool evaluate_sensor();
  // False: emission, importance or a bsdf is zero.
  bool may_be_lit() const;
  // Copies what depends on edge i, on vertex i and its neighbors, or on an end, from the shared vertices of
  // another path. False: they are not shared.
  bool copy_edge(const SharedEnds& shared, std::size_t i);
  bool copy_inner(const SharedEnds& shared, std::size_t i);
  std::array<double, 3> transmittance(const Edge& edge) const;
  // Transmittance of edge i times the cosine at x_i, over the squared length.
  std::array<double, 3> passed_along(std::size_t i) const;
  // Density of a walk's direction to x_v.
  double leaving_density(bool from_light, std::size_t v) const;
  // True if a step to x_v has that density times the edge's geometry, and no medium or straight pass.
  bool steps_plainly(bool from_light, std::size_t v) const {
    return edges_[from_light ? v - 1 : v].is_plain() && !numbers_.in_medium[v];
  }
  double plain_step_density(bool from_light, std::size_t v) const;
  // Density with which the light's (eye's) walk makes its first `count` vertices.
  Scaled walk_density(bool from_light, std::size_t count) const;
  enum class Arrival : std::uint8_t { surface, medium, lens };
  Scaled fly(bool from_light, std::size_t edge, Arrival arrival, bool expects_passes,
             std::array<double, 3>& color, double longest = std::numeric_limits<double>::infinity()) const;
  Vec3d place(std::size_t i) const;

  const scene::Scene& scene_;
  const FullPath& path_;
  Rules rules_;
  bool valid_ = true, media_agree_ = true, closed_form_ = true;
  PathNumbers numbers_;
  std::vector<Edge> edges_;
  PathVector<Inner> inner_;
  std::array<double, 3>
      emitted_{};          // radiance along the first edge; of a delta light as EmissionSample has it
  double importance_ = 0;  // of the last edge, its cosine at the lens included
};

}  // namespace candela::transport::path
