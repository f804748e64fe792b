#include "worker/mcmc/mutators/half_vector.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "worker/core/math.h"
#include "worker/transport/manifold/geometry_terms.h"
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

bool same_kinds(const path::Path& a, const path::Path& b) {
  if (a.vertices.size() != b.vertices.size()) return false;
  for (std::size_t i = 0; i < a.vertices.size(); ++i) {
    const path::PathVertex &v = a.vertices[i], &w = b.vertices[i];
    if (v.kind != w.kind || v.delta != w.delta || v.transmitted != w.transmitted) return false;
  }
  return a.vertices.front() == b.vertices.front() && a.vertices.back() == b.vertices.back();
}

}  // namespace

const std::optional<HalfVectorMutator::Prepared>& HalfVectorMutator::prepared(const PathState& state) const {
  return state
      .memo<PreparedMemo>(this,
                          [&] {
                            auto made = std::make_unique<PreparedMemo>();
                            made->prepared = prepare_path(state);
                            return made;
                          })
      .prepared;
}

// Kept apart from what is prepared: `this` is the owner of that.
const std::optional<path::Segment>& HalfVectorMutator::segment(const PathState& state) const {
  return state
      .memo<SegmentMemo>(&rules_,
                         [&] {
                           auto made = std::make_unique<SegmentMemo>();
                           made->segment = make_segment(state);
                           return made;
                         })
      .segment;
}

std::optional<path::Segment> HalfVectorMutator::make_segment(const PathState& state) const {
  std::optional<path::Segment> out(std::in_place);
  const std::size_t k = state.path.edge_count();
  if (k < 2 || path::make_segment(scene_, state.path, state.assembled(), 0, k, *out) != path::NoSegment::none)
    return std::nullopt;
  const std::vector<double>& alphas = out->alphas;
  const bool specular = std::any_of(alphas.begin(), alphas.end(), [](double alpha) { return !(alpha > 0); });
  if (rules_.one_step && specular) return std::nullopt;
  return out;
}

std::optional<HalfVectorMutator::Prepared> HalfVectorMutator::prepare_path(const PathState& state) const {
  const std::optional<path::Segment>& found = segment(state);
  if (!found) return std::nullopt;
  Prepared out;
  out.segment = &*found;
  const std::size_t k = state.path.edge_count();
  const Vec3d numbers = state.path.vertices.back().place;
  const Vec2 lens{static_cast<float>(numbers.x), static_cast<float>(numbers.y)};
  const auto film =
      path::to_film(scene_, found->chain.vertices[k - 1], state.assembled().edges.back().length, lens);
  if (!film) return std::nullopt;
  auto chain = prepare(found->chain, found->alphas, *film, rules_.step);
  if (!chain) return std::nullopt;
  out.chain = *std::move(chain);
  return out;
}

double HalfVectorMutator::suitability(const PathState& from) const {
  return segment(from) ? 1 : 0;
}

Proposal HalfVectorMutator::propose(const PathState& from, rng::Stream& stream) const {
  const auto& here = prepared(from);
  if (!here) return MutationFailure::no_path;
  std::vector<Pair> normals;
  normals.reserve(here->chain.slopes.size());
  for (std::size_t i = 0; i < here->chain.slopes.size(); ++i) {
    const double u = stream.next_double();
    normals.push_back(normal_pair(u, stream.next_double()));
  }
  const std::vector<Pair> slopes = propose_slopes(here->chain, normals);
  const path::SceneSurfaces surfaces(scene_, *here->segment);
  Chain moved = here->chain.chain;
  if (rules_.one_step) {
    if (!propose_one_step(here->chain, slopes, surfaces, moved)) return MutationFailure::no_path;
  } else {
    const std::vector<double> near = tolerances(here->chain, rules_.step.gamma);
    if (!walk(moved, slopes, near, surfaces, {}).converged()) return MutationFailure::no_convergence;
    if (!returns(moved, here->chain.chain, held_slopes(here->chain), near, surfaces, {}))
      return MutationFailure::no_return;
  }
  return path::with_segment(from.path, *here->segment, moved);
}

std::optional<double> HalfVectorMutator::log_pdf_area(const PathState& from, const PathState& to) const {
  if (!same_kinds(from.path, to.path)) return std::nullopt;
  const auto &here = prepared(from), &there = prepared(to);
  if (!here || !there) return std::nullopt;
  if (rules_.one_step) return log_pdf_one_step_area(here->chain, there->chain.chain);
  double sum = log_pdf_slopes(here->chain, there->chain.slopes) + there->chain.jacobian.log_abs_det();
  for (std::size_t i = 0; i < there->chain.alphas.size(); ++i)
    if (!(there->chain.alphas[i] > 0)) sum += math::log(light_angle_by_constraint(there->chain.chain, i + 1));
  if (!std::isfinite(sum)) return std::nullopt;
  return sum;
}

}  // namespace candela::mcmc
