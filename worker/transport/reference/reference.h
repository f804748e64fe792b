// The oracle: contribution, densities and weights of one whole path, by the literal formulas. Slow, in
// double, and apart from the recursions of mis/, walk.h and technique/, which are tested against it.
//
// A path x_0 ... x_k runs from the light to the eye; P_i, Q_i, C_0, C_k and the techniques are those at the
// top of mis/balance_power.h. Vertices are a position with its surface or medium; bsdfs are prepared anew,
// from the side each walk comes from; what lies between vertices is found by rays of its own.
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
#include <memory>
#include <vector>

#include "worker/scene/scene.h"
#include "worker/transport/vertex.h"

namespace candela::transport::reference {

// mantissa * 2^exponent: products over a thousand vertices. Not negative.
class Scaled {
 public:
  Scaled(double value = 0) : mantissa_(value) { normalise(); }  // NOLINT(google-explicit-constructor)
  Scaled& operator*=(const Scaled& other);
  Scaled& operator/=(const Scaled& other);
  friend Scaled operator*(Scaled a, const Scaled& b) { return a *= b; }
  friend Scaled operator/(Scaled a, const Scaled& b) { return a /= b; }
  friend bool operator<(const Scaled& a, const Scaled& b);
  bool is_zero() const { return mantissa_ == 0; }
  // Zero or infinite where a double cannot hold it.
  double value() const;

 private:
  void normalise();
  double mantissa_;  // 0 or in [1, 2)
  std::int64_t exponent_ = 0;
};

struct InnerVertex {
  VertexKind kind = VertexKind::surface;
  scene::SurfaceHit hit;
  std::uint32_t medium = scene::kNone;  // of a vertex in it
  bool delta = false;                   // the path turns here by a delta lobe
  // Where several delta lobes share a direction: the probability of that meant, by a walk from the eye or (if
  // so said) from the light. 0: any.
  double delta_prob = 0;
  bool delta_prob_from_light = false;
};

struct FullPath {
  scene::SurfaceHit light;  // x_0; of a point its p and emitter alone, of light from outside its emitter
  bool light_infinite = false, light_delta_position = false, light_delta_direction = false;
  Spectrum light_delta_radiance;  // of such a light: intensity or irradiance, as EmissionSample has it
  std::vector<InnerVertex> inner;
  Vec3 lens;       // x_k; orthographic: on the near plane
  Vec3 lens_near;  // where the last edge enters the near plane: media do not count behind it
  bool lens_infinite = false;
  std::vector<Vec3> along;  // unit, from x_i to x_{i+1}

  std::size_t edge_count() const { return inner.size() + 1; }  // k
};

// All that the densities are made of. Index i: vertex x_i, or the edge from x_i to x_{i+1}.
struct PathNumbers {
  std::size_t edges = 0;  // k
  bool light_can_be_hit = false, lens_can_be_hit = false;
  // Of the end points alone; as next event estimation at x_1, or a connection at x_{k-1}, chooses them.
  double light_prob = 0, light_direct = 0, lens_prob = 0, lens_connect = 0;
  // Of the direction in which the light's walk leaves x_i (i < k), and the eye's (i > 0), per solid angle;
  // beyond an end point at infinity: of the place, per area across it. The eye's first counts all its paths.
  std::vector<double> pdf_to_eye, pdf_to_light;
  // Cosine or hazard at x_i for its edge towards the eye, and towards the light; 1 where there is none.
  std::vector<double> factor_to_eye, factor_to_light;
  std::vector<double> survival, distance_squared;  // of edges; distance 1 to infinity
  std::vector<bool> delta, in_medium;              // of vertices
  std::vector<std::uint32_t> medium;               // of vertices in one: its number; kNone on surfaces
  // Of vertices in media, where there are beams: the sine of the angle between their two edges; 0 elsewhere.
  std::vector<double> beam_sine;

  double light_density(std::size_t i) const;  // P_i
  double eye_density(std::size_t i) const;    // Q_i
};

struct Rules {
  float film_border = 0;
  double eye_paths = 1;  // per iteration
  // Walks pass surfaces in expectation, not by chance, on the last edge that they may have.
  std::size_t max_edges = 1u << 30, max_light_edges = 1u << 30;
};

// How often per eye path each technique is run, not raised to any power; 0: not.
struct Counts {
  double hit_light = 1, next_event = 1, connect = 1, light_image = 1, hit_lens = 1;
  double connect_media = 1;                    // share of the connections of two vertices in media
  double merge_surface = 0, merge_medium = 0;  // eta
  // The same of beams: number of light paths times the effective area or length. First the light's entity,
  // then the eye's.
  double point_beam = 0, beam_point = 0, beam_beam = 0;
  // Whether light's and the eye's beams in a medium are long, by its number; beyond: they are short.
  std::vector<bool> long_photon_beams = {}, long_query_beams = {};
  static bool in(const std::vector<bool>& media, std::uint32_t medium) {
    return medium < media.size() && media[medium];
  }
  // Radii of merges in a medium, over those of the eta above, by the number of the medium; beyond: 1.
  std::vector<double> radius_ratios = {};
  double radius_ratio(std::uint32_t medium) const {
    return medium < radius_ratios.size() ? radius_ratios[medium] : 1;
  }
};

struct Technique {
  enum class Kind : std::uint8_t {
    hit_light,
    next_event,
    connect,
    light_image,
    hit_lens,
    merge,
    merge_point_beam,
    merge_beam_point,
    merge_beam_beam
  };
  Kind kind{};
  std::size_t light_vertices = 0;  // s; of a merge the index of the vertex it blurs
  Scaled density;                  // times its count
};

// Every technique that can make the path, with its density: nothing but products.
std::vector<Technique> list_techniques(const PathNumbers& numbers, const Counts& counts);

enum class Heuristic : std::uint8_t { balance, power, maximum, cutoff };
// Weights in the order of the list. Power: beta = 2; cutoff: alpha below which a density relative to the
// largest counts as none [Veach 1997, Sec. 9.2.3]. Maximum: the first of equals has it all.
std::vector<double> weigh(const std::vector<Technique>& techniques, Heuristic heuristic, double alpha = 0.1);

// Everything about a path in its scene.
class Evaluation {
 public:
  // valid() is false where the path cannot be followed: a ray between two vertices does not arrive.
  Evaluation(const scene::Scene& scene, const FullPath& path, const Rules& rules);
  bool valid() const { return valid_; }
  // Media found going from the light and from the eye are the same.
  bool media_agree() const { return media_agree_; }
  // No medium on the way is a grid: the contribution has a closed form.
  bool closed_form() const { return closed_form_; }
  // The relative error that floats may give the path's densities and contribution, as far as it is known:
  // cosines that vanish, and stretches of media, which walks take to end short of surfaces by their error.
  // Not counted: lobes as narrow as the last bits of a direction.
  double rounding() const { return rounding_; }
  const PathNumbers& numbers() const { return numbers_; }

  // The measurement contribution f(x), per channel: emitted radiance, geometric terms, transmittance, bsdfs
  // as radiance has them (towards the light x_{i-1}, with the shading normal's cosine there), importance.
  std::array<Scaled, 3> contribution() const;
  // What a technique gives where it makes this path: f over the density with which it truly does, that of
  // flights and straight passes included; without roulette, and without a merge's kernel.
  std::array<double, 3> estimator_value(const Technique& technique) const;

 private:
  // Of an edge, from the light to the eye: stretches of one medium, and surfaces passed between them.
  struct Stretch {
    std::uint32_t medium = scene::kNone;
    double length = 0;
  };
  struct Pass {
    scene::SurfaceHit hit;
    std::array<double, 3> fraction{};
    double prob_from_light = 1, prob_from_eye = 1;
  };
  struct Edge {
    std::vector<Stretch> stretches;
    std::vector<Pass> passes;
  };
  struct Inner {
    scene::Closure from_light, from_eye;
    scene::ClosureArena arena_light, arena_eye;
    std::array<double, 3> value{};              // rho_i
    double prob_to_eye = 0, prob_to_light = 0;  // true densities of the directions
  };

  bool follow_edge(std::size_t i);
  void assign_media();
  void evaluate_inner(std::size_t i);
  void evaluate_delta(std::size_t i, Vec3 to_light, Vec3 to_eye);
  bool evaluate_ends();
  std::array<double, 3> transmittance(const Edge& edge) const;
  std::array<double, 3> emitted() const;
  // Of the light's (eye's) walk making its first `count` vertices.
  Scaled walk_density(bool from_light, std::size_t count) const;
  enum class Arrival : std::uint8_t { surface, medium, lens };
  Scaled fly(bool from_light, std::size_t edge, Arrival arrival, bool expects_passes,
             std::array<double, 3>& colour) const;
  Vec3d place(std::size_t i) const;
  void count_rounding();

  const scene::Scene& scene_;
  const FullPath& path_;
  Rules rules_;
  bool valid_ = true, media_agree_ = true, closed_form_ = true;
  double rounding_ = 0;
  PathNumbers numbers_;
  std::vector<Edge> edges_;
  std::vector<std::unique_ptr<Inner>> inner_;
  double importance_ = 0;  // of the last edge, its cosine at the lens included
};

}  // namespace candela::transport::reference
