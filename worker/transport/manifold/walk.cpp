#include "worker/transport/manifold/walk.h"

#include <algorithm>
#include <cmath>

namespace candela::transport::manifold {
namespace {

double relative_error(std::span<const Pair> rest, std::span<const double> tolerances, bool& done) {
  double largest = 0;
  done = true;
  for (std::size_t i = 0; i < rest.size(); ++i) {
    const double e = max_abs(rest[i]);
    if (!(e < tolerances[i])) done = false;
    largest = std::max(largest, std::isfinite(e) ? e : HUGE_VAL);
  }
  return largest;
}

void set_rest(const Chain& chain, std::span<const Pair> targets, std::vector<Pair>& rest) {
  rest.resize(targets.size());
  for (std::size_t i = 0; i < rest.size(); ++i) rest[i] = targets[i] - constraint(Form::slope, chain, i + 1);
}

}  // namespace

double tolerance(double gamma, double alpha) {
  return alpha > 0 ? std::clamp(1e-4 * gamma * alpha, 1e-10, 1e-8) : 1e-9;
}

bool projects_from_sensor(const Chain& chain, const BlockTridiagonal& factored) {
  if (chain.from_direction()) return true;
  const std::vector<Mat2> t = factored.by_last_end();
  return std::abs(det(t.front())) < std::abs(det(t.back()));
}

bool project(Chain& chain, std::span<const Vec3d> predicted, bool from_sensor, const Surfaces& surfaces) {
  const std::size_t count = chain.inner_count();
  for (std::size_t step = 1; step <= count; ++step) {
    const std::size_t i = from_sensor ? count + 1 - step : step;
    const ChainVertex& from = chain.vertices[from_sensor ? i + 1 : i - 1];
    if (!surfaces.meet(i, from, predicted[i - 1], chain.vertices[i])) return false;
  }
  return true;
}

std::vector<Vec3d> predicted_places(const Chain& chain, std::span<const Pair> steps) {
  std::vector<Vec3d> places;
  places.reserve(steps.size());
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const ChainVertex& v = chain.vertices[i + 1];
    places.push_back(v.x + v.p_u * steps[i].x + v.p_v * steps[i].y);
  }
  return places;
}

Walked walk(Chain& chain, std::span<const Pair> targets, std::span<const double> tolerances,
            const Surfaces& surfaces, const WalkRules& rules) {
  Walked walked;
  if (fault_of(chain) != Fault::none) return {WalkEnd::unusable_start, 0};
  std::vector<Pair> rest;
  set_rest(chain, targets, rest);
  bool done = false;
  double error = relative_error(rest, tolerances, done);
  bool from_sensor = false, decided = false;
  double step = 1;
  BlockTridiagonal factored;
  std::vector<Pair> full;  // the step of beta = 1 from where the chain is
  std::vector<Pair> steps, next_rest;
  Chain next;
  while (!done) {
    if (walked.iterations == rules.max_iterations) return {WalkEnd::iterations, walked.iterations};
    ++walked.iterations;
    if (full.empty()) {
      if (!factored.factor(blocks(Form::slope, chain))) return {WalkEnd::singular, walked.iterations};
      full = factored.solve(rest);
      if (!decided) from_sensor = projects_from_sensor(chain, factored);
      decided = true;
    }
    steps = full;
    for (Pair& s : steps) s = s * step;
    next = chain;
    bool better =
        project(next, predicted_places(chain, steps), from_sensor, surfaces) && fault_of(next) == Fault::none;
    if (better) {
      set_rest(next, targets, next_rest);
      bool next_done = false;
      const double next_error = relative_error(next_rest, tolerances, next_done);
      better = next_error < error;
      if (better) {
        std::swap(chain, next);
        std::swap(rest, next_rest);
        error = next_error;
        done = next_done;
        full.clear();
      }
    }
    step = better ? std::min(1.0, 2 * step) : step / 2;
    if (step < rules.min_step) return {WalkEnd::short_step, walked.iterations};
  }
  return walked;
}

bool returns(const Chain& moved, const Chain& start, std::span<const Pair> back,
             std::span<const double> tolerances, const Surfaces& surfaces, const WalkRules& rules) {
  Chain chain = moved;
  chain.first = start.first;
  chain.vertices.front() = start.vertices.front();
  chain.vertices.back() = start.vertices.back();
  if (!walk(chain, back, tolerances, surfaces, rules).converged()) return false;
  const double near = rules.return_distance * start.size();
  for (std::size_t i = 1; i + 1 < chain.vertices.size(); ++i)
    if (!(length(chain.vertices[i].x - start.vertices[i].x) < near)) return false;
  return true;
}

}  // namespace candela::transport::manifold
