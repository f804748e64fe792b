#include "worker/mcmc/mutators/manifold.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "worker/core/math.h"
#include "worker/transport/manifold/constraint.h"
#include "worker/transport/manifold/proposal.h"
#include "worker/transport/manifold/walk.h"

namespace candela::mcmc {

using namespace transport::manifold;  // NOLINT(google-build-using-namespace)
namespace path = transport::path;
using path::Kind;
using Choice = ManifoldMutator::Choice;

namespace {

constexpr std::array kScales{1.0, 0.1, 0.01};
constexpr double kMaxAngle = 0.5;  // radians, standard deviation
// Vertices of walks that traced rays of floats are as far off their place.
constexpr WalkRules kWalkRules{.return_distance = 1e-5};

// All choices of three vertices; of those with specular vertices if there are any.
std::vector<Choice> choices(const path::Path& path) {
  std::vector<std::size_t> free;
  free.reserve(path.vertices.size());
  for (std::size_t i = 0; i < path.vertices.size(); ++i)
    if (!path.vertices[i].delta) free.push_back(i);
  const auto can_end_chain = [&](std::size_t end, std::size_t b) {
    return std::max(end, b) - std::min(end, b) == 1 || path.vertices[end].kind != Kind::medium;
  };
  std::vector<Choice> out;
  out.reserve(free.size());
  for (std::size_t j = 1; j + 1 < free.size(); ++j) {
    const std::size_t light = free[j - 1], b = free[j], sensor = free[j + 1];
    if (path.vertices[b].kind != Kind::surface) continue;
    const Kind kind = path.vertices[light].kind;
    const bool turns_at_light = kind != Kind::directed_light && kind != Kind::distant_light;
    const bool from_sensor = sensor - b <= b - light || !turns_at_light;
    const Choice choice = from_sensor ? Choice{sensor, b, light} : Choice{light, b, sensor};
    if (can_end_chain(choice.c, b)) out.push_back(choice);
  }
  const auto any = [](const Choice& choice) { return choice.specular_count() > 0; };
  if (std::any_of(out.begin(), out.end(), any))
    out.erase(std::remove_if(out.begin(), out.end(), [&](const Choice& choice) { return !any(choice); }),
              out.end());
  return out;
}

double draw_scale(rng::Stream& stream) {
  return kScales[std::min(static_cast<std::size_t>(stream.next_double() * kScales.size()),
                          kScales.size() - 1)];
}

// Per area of the plane.
double log_pdf_normal(double deviation, double distance) {
  double sum = 0;
  for (const double scale : kScales) {
    const double s = deviation * scale, x = distance / s;
    sum += math::exp(-0.5 * x * x) / (2 * std::numbers::pi * s * s);
  }
  return math::log(sum / kScales.size());
}

// The von Mises-Fisher distribution of concentration 1 / deviation^2 [Jakob 2012, Sec. 5]; from its 1 - cos.
double von_mises_angle(double deviation, double u) {
  const double kappa = 1 / (deviation * deviation);
  const double less = -math::log(1 - u * (1 - math::exp(-2 * kappa))) / kappa;
  return 2 * math::atan2(std::sqrt(less), std::sqrt(std::max(0.0, 2 - less)));
}
double log_pdf_von_mises(double deviation, Vec3d from, Vec3d to) {
  const double less = 0.5 * length_squared(to - from);
  double sum = 0;
  for (const double scale : kScales) {
    const double kappa = 1 / (deviation * deviation * scale * scale);
    sum += kappa / (2 * std::numbers::pi * (1 - math::exp(-2 * kappa))) * math::exp(-kappa * less);
  }
  return math::log(sum / kScales.size());
}

double length_between(const PathState& state, std::size_t i, std::size_t j) {
  double sum = 0;
  for (std::size_t e = std::min(i, j); e < std::max(i, j); ++e) sum += state.assembled().edges[e].length;
  return sum;
}

Vec3d direction_at(const PathState& state, const Choice& choice) {
  return choice.from_sensor() ? -state.assembled().edges[choice.a - 1].direction
                              : state.assembled().edges[choice.a].direction;
}

bool make_chain(const scene::Scene& scene, const PathState& state, const Choice& choice, path::Segment& out) {
  return path::make_segment(scene, state.path, state.assembled(), std::min(choice.b, choice.c),
                            std::max(choice.b, choice.c), out) == path::NoSegment::none;
}

}  // namespace

struct ManifoldMutator::Choices final : Memo {
  std::vector<Choice> all;
};

const std::vector<Choice>& ManifoldMutator::choices_of(const PathState& from) const {
  return from
      .memo<Choices>(this,
                     [&] {
                       auto made = std::make_unique<Choices>();
                       made->all = choices(from.path);
                       return made;
                     })
      .all;
}

double ManifoldMutator::suitability(const PathState& from) const {
  return choices_of(from).empty() ? 0 : 1;
}

// The angle at a that moves the film position by the step, if nothing but distances counts.
double ManifoldMutator::angle_scale(const PathState& from, const Choice& choice) const {
  const double width =
      pixel_width(from, context_.domain_area(), length_between(from, choice.b, from.path.edge_count()));
  return std::min(step_ * width / length_between(from, choice.a, choice.b), kMaxAngle);
}

bool ManifoldMutator::trace(const PathState& from, const Choice& choice, rng::Stream& stream,
                            path::Path& path) const {
  const Tracer tracer(context_, from);
  const double scale = draw_scale(stream), u = stream.next_double(), v = stream.next_double();
  if (choice.a == path.edge_count()) {
    const Pair offset = normal_pair(u, v) * (step_ * scale);
    const double x = static_cast<double>(from.assembled().film.x) + offset.x,
                 y = static_cast<double>(from.assembled().film.y) + offset.y;
    return on_film(context_, x, y) && tracer.trace_film(x, y, path, choice.b);
  }
  const double angle = von_mises_angle(angle_scale(from, choice) * scale, u);
  return tracer.trace(choice.a, turned(direction_at(from, choice), angle, 2 * std::numbers::pi * v), path,
                      choice.from_sensor() ? choice.a - 1 : choice.a + 1, choice.b);
}

Proposal ManifoldMutator::propose(const PathState& from, rng::Stream& stream) const {
  const std::vector<Choice>& all = choices_of(from);
  if (all.empty()) return MutationFailure::no_path;
  const Choice choice = all[std::min(
      static_cast<std::size_t>(stream.next_double() * static_cast<double>(all.size())), all.size() - 1)];
  path::Path path = from.path;
  if (!trace(from, choice, stream, path)) return MutationFailure::no_path;
  if (!choice.walks()) return path;

  path::Segment segment;
  if (!make_chain(context_.scene, from, choice, segment)) return MutationFailure::no_path;
  Chain moved = segment.chain;
  ChainVertex& end = choice.from_sensor() ? moved.vertices.back() : moved.vertices.front();
  if (!path::set_end_surface(context_.scene, path.vertices[choice.b].point, end))
    return MutationFailure::no_path;
  const std::vector<Pair> held(moved.inner_count());
  const std::vector<double> near(moved.inner_count(), tolerance(1, 0));
  const path::SceneSurfaces surfaces(context_.scene, segment, context_.rays);
  if (!walk(moved, held, near, surfaces, kWalkRules).converged()) return MutationFailure::no_convergence;
  if (!returns(moved, segment.chain, held, near, surfaces, kWalkRules)) return MutationFailure::no_return;
  return path::with_segment(path, segment, moved);
}

// The density of the specular vertices between b and c, given these.
std::optional<double> ManifoldMutator::log_pdf_walk(const PathState& to, const Choice& choice) const {
  path::Segment segment;
  if (!make_chain(context_.scene, to, choice, segment) || fault_of(segment.chain) != Fault::none)
    return std::nullopt;
  BlockTridiagonal jacobian;
  if (!jacobian.factor(blocks(Form::slope, segment.chain))) return std::nullopt;
  double sum = jacobian.log_abs_det();
  for (std::size_t i = 1; i <= segment.chain.inner_count(); ++i)
    sum += math::log(light_angle_by_constraint(segment.chain, i));
  return sum;
}

std::optional<double> ManifoldMutator::log_pdf_area(const PathState& from, const PathState& to) const {
  const std::vector<Choice>& all = choices_of(from);
  const auto moves = [&](const Choice& choice) {
    return differ_within(from.path, to.path, std::min(choice.a, choice.c) + 1,
                         std::max(choice.a, choice.c)) &&
           !(from.path.vertices[choice.b] == to.path.vertices[choice.b]);
  };
  const auto chosen = std::find_if(all.begin(), all.end(), moves);
  if (chosen == all.end()) return std::nullopt;
  const Choice choice = *chosen;
  double sum = -math::log(static_cast<double>(all.size()));
  if (choice.a == from.path.edge_count()) {
    sum +=
        log_pdf_normal(step_, film_distance(from, to)) + log_film_per_direction(to, context_.domain_area());
  } else {
    sum += log_pdf_von_mises(angle_scale(from, choice), direction_at(from, choice), direction_at(to, choice));
  }
  if (choice.from_sensor())
    sum += log_area_towards_light(to, choice.b, choice.a);
  else
    sum += log_area_towards_sensor(to, choice.a, choice.b) +
           log_turns_towards_sensor(context_.scene, to, choice.a, choice.b);
  if (choice.walks()) {
    const auto walked = log_pdf_walk(to, choice);
    if (!walked) return std::nullopt;
    sum += *walked;
  }
  const std::size_t first = choice.from_sensor() ? choice.a - 1 : choice.a + 1;
  if (!std::isfinite(sum) || !Tracer(context_, from).stops_at(to, choice.a, first, choice.b))
    return std::nullopt;
  return sum;
}

}  // namespace candela::mcmc
