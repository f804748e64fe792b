// A whole path between a light and the lens as formulas see it, and the numbers that they give it.
//
// A path x_0 ... x_k runs from the light to the eye; P_i, Q_i, C_0 and C_k are those at the top of
// mis/balance_power.h.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "worker/core/inline_vector.h"
#include "worker/scene/scene.h"
#include "worker/transport/vertex.h"

namespace candela::transport::path {

// Values for vertices or edges of a path.
template <class T>
using PathVector = InlineVector<T, 12>;

// mantissa * 2^exponent: products over a thousand vertices. Not negative.
class Scaled {
 public:
  Scaled(double value = 0) : mantissa_(value) { normalize(); }  // NOLINT(google-explicit-constructor)
  Scaled& operator*=(const Scaled& other) {
    mantissa_ *= other.mantissa_;
    exponent_ += other.exponent_;
    if (mantissa_ >= 1 && mantissa_ < 4) {  // of two mantissas
      const bool carries = mantissa_ >= 2;
      mantissa_ *= carries ? 0.5 : 1.0;
      exponent_ += carries ? 1 : 0;
      return *this;
    }
    if (mantissa_ == 0) exponent_ = 0;
    normalize_rare();
    return *this;
  }
  Scaled& operator/=(const Scaled& other) {
    mantissa_ /= other.mantissa_;
    exponent_ -= other.exponent_;
    if (mantissa_ > 0.5 && mantissa_ < 2) {
      const bool borrows = mantissa_ < 1;
      mantissa_ *= borrows ? 2.0 : 1.0;
      exponent_ -= borrows ? 1 : 0;
      return *this;
    }
    if (mantissa_ == 0) exponent_ = 0;
    normalize_rare();
    return *this;
  }
  friend Scaled operator*(Scaled a, const Scaled& b) { return a *= b; }
  friend Scaled operator/(Scaled a, const Scaled& b) { return a /= b; }
  friend bool operator<(const Scaled& a, const Scaled& b);
  bool is_zero() const { return mantissa_ == 0; }
  Scaled& operator+=(const Scaled& other);
  // Zero or infinite where a double cannot hold it.
  double value() const;
  // True if a double holds it, and it is not zero.
  bool holds() const { return mantissa_ >= 1 && mantissa_ < 2 && exponent_ > -kBias && exponent_ <= kBias; }
  double log() const;  // minus infinity of zero

 private:
  void normalize() {
    const auto bits = std::bit_cast<std::uint64_t>(mantissa_);
    const std::uint64_t exponent = bits >> kFractionBits & 0x7ff;
    if (bits == 0) return;
    if (exponent == 0 || exponent == 0x7ff) return normalize_rare();
    mantissa_ = std::bit_cast<double>((bits & ~(std::uint64_t{0x7ff} << kFractionBits)) |
                                      std::uint64_t{kBias} << kFractionBits);
    exponent_ += static_cast<std::int64_t>(exponent) - kBias;
  }
  void normalize_rare();  // zero, denormal, or not finite

  static constexpr int kFractionBits = 52, kBias = 1023;  // of a double
  double mantissa_;                                       // 0 or in [1, 2)
  std::int64_t exponent_ = 0;
};

// A density that a double cannot hold counts as none.
inline double held(double density) {
  return density >= std::numeric_limits<double>::min() && density <= std::numeric_limits<double>::max()
             ? density
             : 0;
}

// Neighbor of a mollified vertex (mollified.h) towards which the cone around its delta lobe opens.
enum class Cone : std::uint8_t { none, towards_light, towards_eye };

struct InnerVertex {
  VertexKind kind = VertexKind::surface;
  scene::SurfaceHit hit;
  std::uint32_t medium = scene::kNone;  // of a vertex in it
  bool delta = false;                   // the path turns here by a delta lobe
  // If several delta lobes share a direction: the probability of that meant, by a walk from the eye or (if
  // so said) from the light. 0: any.
  double delta_prob = 0;
  bool delta_prob_from_light = false;
  Cone cone = Cone::none;
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
  // Densities of the end points; as next event estimation at x_1, or a connection at x_{k-1}, chooses them.
  double light_prob = 0, light_direct = 0, lens_prob = 0, lens_connect = 0;
  // Densities per solid angle of the direction in which the light's walk leaves x_i (i < k), the eye's i > 0;
  // beyond an end point at infinity: of the place, per area across it. The eye's first counts all its paths.
  PathVector<double> pdf_to_eye, pdf_to_light;
  // Cosine or hazard at x_i for its edge towards the eye, and towards the light; 1 where there is none.
  PathVector<double> factor_to_eye, factor_to_light;
  PathVector<double> survival, distance_squared;  // of edges; distance 1 to infinity
  PathVector<std::uint8_t> delta, in_medium;      // of vertices: flags
  PathVector<std::uint32_t> medium;               // of vertices in one: its number; kNone on surfaces
  // Vertices in media, if there are beams: the sine of the angle between their two edges; 0 elsewhere.
  PathVector<double> beam_sine;

  double light_density(std::size_t i) const;  // P_i
  double eye_density(std::size_t i) const;    // Q_i
};

struct Rules {
  float film_border = 0;
  double eye_paths = 1;  // per iteration
  // Walks pass surfaces in expectation, not by chance, on the last edge that they may have.
  std::size_t max_edges = 1u << 30, max_light_edges = 1u << 30;
  double bandwidth = 0;           // of mollified vertices; 0: there are none
  std::uint64_t* rays = nullptr;  // counts the rays of an evaluation; null: nobody does
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

}  // namespace candela::transport::path
