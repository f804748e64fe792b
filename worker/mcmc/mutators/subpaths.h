// New vertices of a path: a walk from the light, or from the last vertex that is kept on the light's side;
// one from the eye, or from the last vertex kept on the eye's side; and an edge that joins them, which nobody
// samples. With nothing kept this is bidirectional path tracing of one length by one technique.
//
// L and R vertices are kept, s and t are new; s + t of them are chosen before. The techniques of [Veach 1997,
// Sec. 10.2], with their densities per area:
//   L = 0   s = 0: the eye's walk meets the light; s = 1: next event estimation; s >= 2: emission
//   R = 0   t = 0: the light's walk meets the lens; t = 1: a point of the lens; t >= 2: a ray through the
//   film
// A single vertex that is kept of a side is an end: it is joined, and no walk goes on from it. Walks have no
// Russian roulette.
//
// With a bandwidth the joining edge may have a mollified end (transport/path/mollified.h): of a path that
// turns there by a delta lobe no technique can be another one. Ends whose bsdf has both kinds of lobes are
// joined in one of the ways that there are, each as probable as the others.
#pragma once

#include <cstdint>
#include <optional>

#include "worker/mcmc/mutators/context.h"
#include "worker/mcmc/mutators/mutator.h"

namespace candela::mcmc {

class Subpaths {
 public:
  // Numbers of vertices that a path keeps from the light's end and from the sensor's.
  struct Kept {
    std::size_t light = 0, eye = 0;
  };
  // Values of s, each as probable as the others.
  struct Choices {
    std::size_t first = 0, count = 0;
  };

  explicit Subpaths(const MutatorContext& context);

  // The ways to split `added` vertices. They follow from the numbers and the scene.
  Choices choices(const Kept& kept, std::size_t added) const {
    const std::size_t needs = (kept.light == 0 ? 1u : 0u) + (kept.eye == 0 ? 1u : 0u);
    if (added < needs) return {};
    std::size_t first = 0, last = added;
    if (kept.light == 0 && !hits_lights_) first = 1;
    if (kept.eye == 0 && !hits_lens_) last = added - 1;
    if (kept.light == 1) last = 0;
    if (kept.eye == 1) first = added;
    if (first > last) return {};
    return {first, last - first + 1};
  }
  // A path with `added` new vertices, s of them by the light's walk. from: the path that is kept in part;
  // null if nothing is. Preconditions: s is one of the choices, vertices at the ends of what is kept turn by
  // no delta lobe, and the path has at least 2 edges.
  Proposal make(const PathState* from, const Kept& kept, std::size_t added, std::size_t s,
                rng::Stream& stream) const;
  // Computes what densities of `path` are made of. near: the state near which it was made; what follows from
  // the vertices that both share at the light's end is copied. The densities are the same to the bit.
  void prepare(const PathState& path, const PathState& near) const { densities(path, &near); }
  // The log of the density with which make() chose the vertices of `path` that are not kept, over the choices
  // of s. Nothing: it never does.
  std::optional<double> log_pdf_area(const PathState& path, const Kept& kept) const;
  // The same of one s; minus infinity: never.
  double log_pdf_area(const PathState& path, const Kept& kept, std::size_t s) const;

 private:
  // The ways to take the ends x_{joint - 1} and x_joint of the joining edge.
  struct Ways {
    bool regular = false, light_end = false, eye_end = false;  // no cone; a cone at this end
    std::uint32_t count() const { return (regular ? 1u : 0u) + (light_end ? 1u : 0u) + (eye_end ? 1u : 0u); }
  };
  Ways ways(const transport::path::Path& path, const transport::path::Assembled& assembled, const Kept& kept,
            std::size_t joint) const;
  void choose_way(transport::path::Path& path, const Kept& kept, std::size_t joint,
                  rng::Stream& stream) const;
  // Probability of the way of such a path; 0: no way makes it.
  double prob_way(const PathState& state, const Kept& kept, std::size_t joint) const;
  struct Densities;
  // Number: double, or Scaled where a double cannot hold the products.
  template <class Number>
  struct Walks;
  template <class Number>
  Number pdf_area(const PathState& path, const Densities& all, const Walks<Number>& d, const Kept& kept,
                  std::size_t s) const;
  template <class Number>
  transport::path::Scaled sum_area(const PathState& path, const Densities& all, const Walks<Number>& walks,
                                   const Kept& kept, const Choices& choices) const;
  const Densities& densities(const PathState& path, const PathState* near = nullptr) const;

  const MutatorContext context_;
  bool hits_lights_ = false, hits_lens_ = false;
};

// log of the sum of exponentials; nothing: of none.
class LogSum {
 public:
  void add(double log_value);
  std::optional<double> value() const;

 private:
  double largest_ = 0, sum_ = 0;  // sum of exp(log_value - largest)
};

}  // namespace candela::mcmc
