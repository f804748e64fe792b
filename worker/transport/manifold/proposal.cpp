#include "worker/transport/manifold/proposal.h"

#include <cmath>
#include <numbers>
#include <utility>

#include "worker/core/math.h"
#include "worker/transport/manifold/walk.h"

namespace candela::transport::manifold {
namespace {

// L L^T of a symmetric positive definite matrix: xx, yx, yy.
Mat2 cholesky(const Mat2& m) {
  const double xx = std::sqrt(m.xx), yx = m.yx / xx;
  return {xx, 0, yx, std::sqrt(m.yy - yx * yx)};
}

}  // namespace

std::optional<PreparedChain> prepare(Chain chain, std::vector<double> alphas, const Mat2& to_film,
                                     const StepRules& rules) {
  PreparedChain out;
  out.chain = std::move(chain);
  out.alphas = std::move(alphas);
  if (fault_of(out.chain) != Fault::none) return std::nullopt;
  out.slopes = constraints(Form::slope, out.chain);
  out.blocks = blocks(Form::slope, out.chain);
  if (!out.jacobian.factor(out.blocks)) return std::nullopt;
  out.from_sensor = projects_from_sensor(out.chain, out.jacobian);
  double sum = 0;
  for (const double alpha : out.alphas) sum += alpha;
  const std::vector<Mat2> d = out.jacobian.last_vertex_by_constraints();
  out.precisions.reserve(out.alphas.size());
  for (std::size_t i = 0; i < out.alphas.size(); ++i) {
    const double alpha = out.alphas[i];
    Mat2 precision;
    if (alpha > 0) {
      const Mat2 k = to_film * d[i];
      const double lobe = 2 / (rules.gamma * alpha * rules.gamma * alpha);
      const double image = rules.image_step * alpha / sum;
      precision = transposed(k) * k * (1 / (image * image)) + Mat2{lobe, 0, 0, lobe};
      if (!std::isfinite(det(precision))) return std::nullopt;
    }
    out.precisions.push_back(precision);
  }
  return out;
}

std::vector<Pair> propose_slopes(const PreparedChain& from, std::span<const Pair> normals) {
  std::vector<Pair> out(from.slopes.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (!(from.alphas[i] > 0)) continue;  // exactly 0, not where it is: errors do not accumulate
    const Mat2 l = cholesky(from.precisions[i]);
    const double y = normals[i].y / l.yy;
    out[i] = from.slopes[i] + Pair{(normals[i].x - l.yx * y) / l.xx, y};
  }
  return out;
}

double log_pdf_slopes(const PreparedChain& from, std::span<const Pair> to) {
  constexpr double kLogTwoPi = 1.8378770664093454836;
  double sum = 0;
  for (std::size_t i = 0; i < to.size(); ++i) {
    if (!(from.alphas[i] > 0)) continue;
    const Pair d = to[i] - from.slopes[i];
    sum += 0.5 * math::log(det(from.precisions[i])) - kLogTwoPi - 0.5 * dot(d, from.precisions[i] * d);
  }
  return sum;
}

Pair normal_pair(double u, double v) {
  const double r = std::sqrt(-2 * math::log(1 - u));
  double sine = 0, cosine = 0;
  math::sincos(2 * std::numbers::pi * v, sine, cosine);
  return {r * cosine, r * sine};
}

bool propose_one_step(const PreparedChain& from, std::span<const Pair> slopes, const Surfaces& surfaces,
                      Chain& to) {
  std::vector<Pair> change(slopes.begin(), slopes.end());
  for (std::size_t i = 0; i < change.size(); ++i) change[i] = change[i] - from.slopes[i];
  to = from.chain;
  return project(to, predicted_places(from.chain, from.jacobian.solve(change)), from.from_sensor, surfaces);
}

std::optional<double> log_pdf_one_step_area(const PreparedChain& from, const Chain& to,
                                            std::vector<Pair>* slopes) {
  const std::size_t count = from.slopes.size();
  std::vector<Pair> steps(count);
  double log_projection = 0;
  for (std::size_t i = 1; i <= count; ++i) {
    const Vec3d start = to.vertices[from.from_sensor ? i + 1 : i - 1].x;
    const ChainVertex &x = from.chain.vertices[i], &y = to.vertices[i];
    const Vec3d d = y.x - start;
    const double l = length(d);
    const Vec3d w = d / l;
    const double fall = dot(w, x.ng), t = dot(x.x - start, x.ng) / fall;
    if (!(std::abs(fall) > 1e-9) || !(t > 0)) return std::nullopt;
    const Vec3d offset = start + w * t - x.x;
    steps[i - 1] = {dot(offset, x.p_u), dot(offset, x.p_v)};
    // Both terms per solid angle at the ray's start.
    log_projection += math::log(std::abs(dot(w, y.ng)) / (l * l)) - math::log(std::abs(fall) / (t * t));
  }
  std::vector<Pair> proposed = multiply(from.blocks, steps);
  for (std::size_t i = 0; i < count; ++i) proposed[i] = proposed[i] + from.slopes[i];
  const double log_pdf = log_pdf_slopes(from, proposed) + from.jacobian.log_abs_det() + log_projection;
  if (slopes != nullptr) *slopes = std::move(proposed);
  if (!std::isfinite(log_pdf)) return std::nullopt;
  return log_pdf;
}

}  // namespace candela::transport::manifold
