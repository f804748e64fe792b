#include "worker/mcmc/mutators/half_vector.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "worker/core/inline_vector.h"
#include "worker/core/math.h"
#include "worker/mcmc/mutators/tracing.h"
#include "worker/transport/manifold/constraint.h"
#include "worker/transport/manifold/walk.h"

namespace candela::mcmc {

using namespace transport::manifold;  // NOLINT(google-build-using-namespace)
namespace path = transport::path;

namespace {

std::vector<double> tolerances(const PreparedChain& chain, double gamma) {
  std::vector<double> out;
  out.reserve(chain.alphas.size());
  for (const double alpha : chain.alphas) out.push_back(tolerance(gamma, alpha));
  return out;
}

// Slopes of the present path; a specular one is 0, whatever rounding left of it.
std::vector<Pair> held_slopes(const PreparedChain& chain) {
  std::vector<Pair> out = chain.slopes;
  for (std::size_t i = 0; i < out.size(); ++i)
    if (!(chain.alphas[i] > 0)) out[i] = {};
  return out;
}

// A lobe as wide as this is diffuse.
constexpr double kDiffuse = 0.5;

bool same_kinds(const path::Path& a, const path::Path& b) {
  return differ_within(a, b, 1, a.vertices.size() - 1);
}

// The stretch of both paths in which they differ. Nothing: there is none, or the paths are broken elsewhere.
template <class Stretch>
std::optional<std::size_t> moved_stretch(const std::vector<Stretch>& from, const std::vector<Stretch>& to,
                                         const path::Path& a, const path::Path& b) {
  if (from.size() != to.size()) return std::nullopt;
  const path::PathRange changed = path::changed_range(a, b);
  std::optional<std::size_t> found;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const path::Segment &x = from[i].segment, &y = to[i].segment;
    if (x.begin != y.begin || x.end != y.end) return std::nullopt;
    if (x.begin < changed.begin && changed.end <= x.end) found = i;
  }
  return found;
}

// The owner of Breaks, which follow from the path alone.
constexpr char kBreaks = 0;

// The inner vertices, from the light on: 1 where the path is broken.
struct Breaks final : Memo {
  InlineVector<std::uint8_t, 12> at;
};

bool breaks(const scene::Scene& scene, const PathState& state, std::size_t i) {
  const path::PathVertex& vertex = state.path.vertices[i];
  if (vertex.delta) return false;
  // Most vertices are diffuse, whatever segment they would be in.
  if (vertex.kind == path::Kind::surface &&
      path::least_alpha(scene, state.path, state.assembled(), i) >= kDiffuse)
    return true;
  path::Segment alone;
  if (path::make_segment(scene, state.path, state.assembled(), i - 1, i + 1, alone) != path::NoSegment::none)
    return true;
  return alone.alphas.front() >= kDiffuse;
}

const Breaks& breaks_of(const scene::Scene& scene, const PathState& state) {
  return state.memo<Breaks>(&kBreaks, [&] {
    auto made = std::make_unique<Breaks>();
    for (std::size_t i = 1; i < state.path.edge_count(); ++i)
      made->at.push_back(breaks(scene, state, i) ? 1 : 0);
    return made;
  });
}

}  // namespace

void HalfVectorMutator::add_stretch(const PathState& state, std::size_t begin, std::size_t end,
                                    std::vector<Stretch>& out) const {
  if (end < begin + 2) return;
  Stretch made;
  if (path::make_segment(scene_, state.path, state.assembled(), begin, end, made.segment) !=
      path::NoSegment::none)
    return;
  const std::vector<double>& alphas = made.segment.alphas;
  const bool specular = std::any_of(alphas.begin(), alphas.end(), [](double alpha) { return !(alpha > 0); });
  const bool glossy = std::any_of(alphas.begin(), alphas.end(), [](double alpha) { return alpha > 0; });
  // Without a slope that is free nothing of a segment moves.
  if ((rules_.one_step && specular) || (rules_.segments && !glossy)) return;
  out.push_back(std::move(made));
}

const std::vector<HalfVectorMutator::Stretch>& HalfVectorMutator::stretches(const PathState& state) const {
  return state
      .memo<Stretches>(this,
                       [&] {
                         auto made = std::make_unique<Stretches>();
                         const std::size_t k = state.path.edge_count();
                         std::size_t begin = 0;
                         for (std::size_t i = 1; rules_.segments && i < k; ++i) {
                           if (breaks_of(scene_, state).at[i - 1] == 0) continue;
                           add_stretch(state, begin, i, made->all);
                           begin = i;
                         }
                         add_stretch(state, begin, k, made->all);
                         return made;
                       })
      .all;
}

const std::optional<PreparedChain>& HalfVectorMutator::prepared(const PathState& state,
                                                                const Stretch& stretch) const {
  if (!stretch.is_prepared) stretch.chain = prepare_stretch(state, stretch.segment);
  stretch.is_prepared = true;
  return stretch.chain;
}

std::optional<PreparedChain> HalfVectorMutator::prepare_stretch(const PathState& state,
                                                                const path::Segment& segment) const {
  const std::size_t k = state.path.edge_count();
  Mat2 on_film;  // 0: the vertex next to the sensor stays, and so does the film position
  if (segment.end == k) {
    const Vec3d numbers = state.path.vertices.back().place;
    const Vec2 lens{static_cast<float>(numbers.x), static_cast<float>(numbers.y)};
    const auto film = path::to_film(scene_, segment.chain.vertices[segment.chain.vertices.size() - 2],
                                    state.assembled().edges.back().length, lens);
    if (!film) return std::nullopt;
    on_film = *film;
  }
  return prepare(segment.chain, segment.alphas, on_film, rules_.step);
}

double HalfVectorMutator::suitability(const PathState& from) const {
  return stretches(from).empty() ? 0 : 1;
}

Proposal HalfVectorMutator::propose(const PathState& from, rng::Stream& stream) const {
  const std::vector<Stretch>& all = stretches(from);
  if (all.empty()) return MutationFailure::no_path;
  std::size_t chosen = 0;
  if (rules_.segments)
    chosen = std::min(static_cast<std::size_t>(stream.next_double() * static_cast<double>(all.size())),
                      all.size() - 1);
  const path::Segment& segment = all[chosen].segment;
  const auto& here = prepared(from, all[chosen]);
  if (!here) return MutationFailure::no_path;
  std::vector<Pair> normals;
  normals.reserve(here->slopes.size());
  for (std::size_t i = 0; i < here->slopes.size(); ++i) {
    const double u = stream.next_double();
    normals.push_back(normal_pair(u, stream.next_double()));
  }
  const std::vector<Pair> slopes = propose_slopes(*here, normals);
  const path::SceneSurfaces surfaces(scene_, segment, rays_);
  Chain moved = here->chain;
  if (rules_.one_step) {
    if (!propose_one_step(*here, slopes, surfaces, moved)) return MutationFailure::no_path;
  } else {
    const std::vector<double> near = tolerances(*here, rules_.step.gamma);
    if (!walk(moved, slopes, near, surfaces, {}).converged()) return MutationFailure::no_convergence;
    if (!returns(moved, here->chain, held_slopes(*here), near, surfaces, {}))
      return MutationFailure::no_return;
  }
  return path::with_segment(from.path, segment, moved);
}

std::optional<double> HalfVectorMutator::log_pdf_area(const PathState& from, const PathState& to) const {
  if (!same_kinds(from.path, to.path)) return std::nullopt;
  const std::vector<Stretch>&all = stretches(from), &others = stretches(to);
  if (all.empty() || others.empty()) return std::nullopt;
  const auto moved =
      rules_.segments ? moved_stretch(all, others, from.path, to.path) : std::optional<std::size_t>(0);
  if (!moved) return std::nullopt;
  const auto &here = prepared(from, all[*moved]), &there = prepared(to, others[*moved]);
  if (!here || !there) return std::nullopt;
  const double log_chosen = -math::log(static_cast<double>(all.size()));
  if (rules_.one_step) {
    const auto step = log_pdf_one_step_area(*here, there->chain);
    return step ? std::optional(*step + log_chosen) : std::nullopt;
  }
  double sum = log_chosen + log_pdf_slopes(*here, there->slopes) + there->jacobian.log_abs_det();
  for (std::size_t i = 0; i < there->alphas.size(); ++i)
    if (!(there->alphas[i] > 0)) sum += math::log(light_angle_by_constraint(there->chain, i + 1));
  if (!std::isfinite(sum)) return std::nullopt;
  return sum;
}

}  // namespace candela::mcmc
