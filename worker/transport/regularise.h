// Path-space regularization by mollified connections [Kaplanyan 2017, ch. 6; regularisation note]: which
// paths, which vertex, the kernel, and the bandwidth. Pure functions; no integrator knows more.
//
// A path runs from the light x_0 to the sensor x_k. Its string has a letter for each part: the place and the
// direction of the light, the vertices x_1 ... x_{k-1}, the direction and the place of the sensor. A letter
// is S if the part has a delta function, D if not; that of a vertex is of the lobe in use. A light that is
// infinitely far away counts with its direction as its place, and an orthographic camera likewise.
//
// Technique s (s vertices from the light, k + 1 - s from the eye) needs the letters s and s + 1 to be D. Its
// cost is the number of S among the two. A path is mollified if all techniques that an integrator runs have a
// cost: a delta lobe at one end of its connection edge is replaced by a cone of solid angle around the lobe's
// direction, with the half angle atan(r / l): l is the edge's length, r the bandwidth.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>

#include "worker/core/vec.h"

namespace candela::transport {

enum class Letter : std::uint8_t { diffuse, specular };  // D, S

// The techniques that an integrator runs.
enum class Connecting : std::uint8_t {
  next_event,     // s = 0, 1
  bidirectional,  // s = 0 ... k + 1
};

// The whole string. Letters: 2 + (k - 1) + 2 of them, in the order above.
// [regularisation note, section 1]
inline std::uint32_t cost(std::span<const Letter> string, std::uint32_t s) {
  return static_cast<std::uint32_t>(string[s] == Letter::specular) +
         static_cast<std::uint32_t>(string[s + 1] == Letter::specular);
}
// True if no technique can sample the path. [regularisation note, section 2]
bool mollify(std::span<const Letter> string, Connecting techniques);
// The least cost of the techniques that may mollify the path: s = 1, or 1 <= s <= k.
std::uint32_t least_cost(std::span<const Letter> string, Connecting techniques);
// The technique that mollifies the path, of those of least cost the one whose connection edge is the longest,
// and of these the one with the fewest vertices from the light; lengths[s - 1]: of the edge x_{s-1} x_s. 0:
// none, as one letter S has to do. Precondition: mollify(string, techniques).
// [regularisation note, section 3]
std::uint32_t choose(std::span<const Letter> string, Connecting techniques, std::span<const double> lengths);

// The letters of a subpath from its end point on, for Connecting::bidirectional: all that the functions above
// would have to know of them.
class SubpathString {
 public:
  SubpathString() = default;
  SubpathString(Letter place, Letter direction) : last_(place) { add(direction, 0); }

  // The next letter, of the vertex that an edge of this length leads to.
  void add(Letter letter, double length) {
    const bool diffuse = letter == Letter::diffuse, was_diffuse = last_ == Letter::diffuse;
    samplable_ = samplable_ || (diffuse && was_diffuse);
    if (diffuse != was_diffuse) longest_ = std::max(longest_, length);
    last_ = letter;
  }
  // Some technique samples all paths that begin like this.
  bool samplable() const { return samplable_; }
  Letter last() const { return last_; }
  // The longest edge so far whose technique has the cost 1.
  double longest() const { return longest_; }

 private:
  bool samplable_ = false;
  Letter last_ = Letter::diffuse;
  double longest_ = 0;
};

// True if the technique whose connection edge of this length joins two subpaths mollifies the path.
// Complementary comparisons: of edges of one length that nearest to the light counts.
inline bool mollifies(const SubpathString& light, const SubpathString& eye, double length) {
  return !light.samplable() && !eye.samplable() && light.last() != eye.last() && length > light.longest() &&
         length >= eye.longest();
}

// The cone of bandwidth r > 0 for an edge of the length l: K / l^2 and the half angle belong to max(l, r), so
// that no edge has a singularity.
class Mollifier {
 public:
  Mollifier() = default;
  explicit Mollifier(double bandwidth) : r2_(bandwidth * bandwidth) {}

  // True if `to`, from the mollified vertex to the other end of the edge, is in the cone around the lobe's
  // direction o, a unit vector. [regularisation note, section 4]
  bool inside(Vec3d o, Vec3d to) const {
    const double l2 = length_squared(to);
    return dot(o, to) > 0 && length_squared(cross(o, to)) * (std::max(l2, r2_) + r2_) < l2 * r2_;
  }
  // K / l^2 per area, K = 1 / (2 pi (1 - cos(atan(r / l)))), for an edge of this squared length: without a
  // small difference. [regularisation note, section 4]
  double value_over_length_squared(double length_squared) const {
    const double q = r2_ / std::max(length_squared, r2_);
    return (1 + q + std::sqrt(1 + q)) / (2 * std::numbers::pi * r2_);
  }
  // K l^2 / max(l, r)^2, for a light whose value has l^2 already.
  double value(double length_squared) const {
    return value_over_length_squared(length_squared) * length_squared;
  }

 private:
  double r2_ = 1;
};

// No bandwidth is a smaller fraction of the first one, so that K is finite.
inline constexpr double kMinShare = 1e-6;

// r_0 n^-exponent, n = iteration + 1: of an iteration of the job, counted from 0.
// [regularisation note, sections 6, 7]
double bandwidth(double first, std::uint64_t iteration, double exponent);

}  // namespace candela::transport
