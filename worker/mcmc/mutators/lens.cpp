#include "worker/mcmc/mutators/lens.h"

#include <cmath>
#include <numbers>

#include "worker/core/math.h"

namespace candela::mcmc {

namespace path = transport::path;
using path::Kind;

namespace {

// A new chain begins at a vertex that is not specular, before a specular one.
bool begins_chain(const path::Path& path, std::size_t i) {
  return i > 0 && !path.vertices[i].delta && path.vertices[i - 1].delta;
}

// The vertex up to which rays make the path anew. Nothing: the mutation does not suit.
std::optional<std::size_t> traced_end(const path::Path& path, bool multichain) {
  bool several = false;
  for (std::size_t i = path.edge_count(); i-- > 0;) {
    const path::PathVertex& v = path.vertices[i];
    if (v.kind == Kind::medium || v.kind == Kind::point_light || v.kind == Kind::directed_light)
      return std::nullopt;
    if (v.delta) continue;
    if (!begins_chain(path, i)) return several == multichain ? std::optional(i) : std::nullopt;
    several = true;
  }
  return std::nullopt;
}

}  // namespace

double LensMutator::suitability(const PathState& from) const {
  return traced_end(from.path, rules_.multichain) ? 1 : 0;
}

Proposal LensMutator::propose(const PathState& from, rng::Stream& stream) const {
  const auto end = traced_end(from.path, rules_.multichain);
  if (!end) return MutationFailure::no_path;
  const double radius = rules_.film.sample(stream);
  double sine = 0, cosine = 0;
  math::sincos(2 * std::numbers::pi * stream.next_double(), sine, cosine);
  const double x = static_cast<double>(from.assembled().film.x) + radius * cosine,
               y = static_cast<double>(from.assembled().film.y) + radius * sine;
  if (!on_film(context_, x, y)) return MutationFailure::dark;

  path::Path path = from.path;
  const Tracer tracer(context_, from);
  const auto chain_end = [&](std::size_t i) {
    while (i > *end && path.vertices[i].delta) --i;
    return i;
  };
  std::size_t at = chain_end(path.edge_count() - 1);
  if (!tracer.trace_film(x, y, path, at)) return MutationFailure::no_path;
  while (at > *end) {
    const double angle = rules_.angle.sample(stream);
    const Vec3d direction =
        turned(-from.assembled().edges[at - 1].direction, angle, 2 * std::numbers::pi * stream.next_double());
    const std::size_t next = chain_end(at - 1);
    if (!tracer.trace(at, direction, path, at - 1, next)) return MutationFailure::no_path;
    at = next;
  }
  return path;
}

std::optional<double> LensMutator::log_pdf_area(const PathState& from, const PathState& to) const {
  const auto end = traced_end(from.path, rules_.multichain);
  const std::size_t k = from.path.edge_count();
  if (!end || !differ_within(from.path, to.path, *end, k)) return std::nullopt;
  const auto step = rules_.film.log_pdf_plane(film_distance(from, to));
  if (!step) return std::nullopt;
  double sum =
      *step + log_film_per_direction(to, context_.domain_area()) + log_area_towards_light(to, *end, k);
  for (std::size_t i = *end + 1; i < k; ++i) {
    if (!begins_chain(from.path, i)) continue;
    const auto turn = rules_.angle.log_pdf_solid_angle(
        angle_between(from.assembled().edges[i - 1].direction, to.assembled().edges[i - 1].direction));
    if (!turn) return std::nullopt;
    sum += *turn;
  }
  if (!std::isfinite(sum) || !Tracer(context_, from).stops_at(to, k, k - 1, *end)) return std::nullopt;
  return sum;
}

}  // namespace candela::mcmc
