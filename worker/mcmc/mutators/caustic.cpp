#include "worker/mcmc/mutators/caustic.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace candela::mcmc {

namespace path = transport::path;
using path::Kind;

namespace {

// x_l. Nothing: the mutation does not suit.
std::optional<std::size_t> turned_vertex(const path::Path& path) {
  const std::size_t k = path.edge_count();
  if (k < 2 || path.vertices[k - 1].kind != Kind::surface || path.vertices[k - 1].delta) return std::nullopt;
  std::size_t l = k - 2;
  while (l > 0 && path.vertices[l].delta) --l;
  const Kind kind = path.vertices[l].kind;
  if (kind == Kind::directed_light || kind == Kind::distant_light) return std::nullopt;
  return l;
}

}  // namespace

LogStep CausticMutator::angles(const PathState& from, std::size_t begin) const {
  const auto& edges = from.assembled().edges;
  double distance = 0;
  for (std::size_t i = begin; i + 1 < edges.size(); ++i) distance += edges[i].length;
  const double per_pixel = pixel_width(from, context_.domain_area(), edges.back().length) / distance;
  const double max = std::min(per_pixel * film_.max, std::numbers::pi / 2);
  return {max * film_.min / film_.max, max};
}

double CausticMutator::suitability(const PathState& from) const {
  return turned_vertex(from.path) ? 1 : 0;
}

Proposal CausticMutator::propose(const PathState& from, rng::Stream& stream) const {
  const auto begin = turned_vertex(from.path);
  if (!begin) return MutationFailure::no_path;
  const double angle = angles(from, *begin).sample(stream);
  const Vec3d direction =
      turned(from.assembled().edges[*begin].direction, angle, 2 * std::numbers::pi * stream.next_double());
  path::Path path = from.path;
  if (!Tracer(context_, from).trace(*begin, direction, path, *begin + 1, path.edge_count() - 1))
    return MutationFailure::no_path;
  return path;
}

std::optional<double> CausticMutator::log_pdf_area(const PathState& from, const PathState& to) const {
  const auto begin = turned_vertex(from.path);
  const std::size_t k = from.path.edge_count();
  if (!begin || !differ_within(from.path, to.path, *begin + 1, k)) return std::nullopt;
  const auto turn = angles(from, *begin)
                        .log_pdf_solid_angle(angle_between(from.assembled().edges[*begin].direction,
                                                           to.assembled().edges[*begin].direction));
  if (!turn) return std::nullopt;
  const double sum = *turn + log_area_towards_sensor(to, *begin, k - 1) +
                     log_turns_towards_sensor(context_.scene, to, *begin, k - 1);
  if (!std::isfinite(sum) || !Tracer(context_, from).stops_at(to, *begin, *begin + 1, k - 1))
    return std::nullopt;
  return sum;
}

}  // namespace candela::mcmc
