#include "worker/transport/manifold/block_tridiagonal.h"

#include <cmath>

#include "worker/core/math.h"

namespace candela::transport::manifold {
namespace {

constexpr double kSingular = 1e-12;  // of |U_i|, relative to the size of B_i

}  // namespace

bool BlockTridiagonal::factor(std::span<const Blocks> blocks) {
  lower_.clear();
  inverse_u_.clear();
  upper_.clear();
  lower_.reserve(blocks.size());
  inverse_u_.reserve(blocks.size());
  upper_.reserve(blocks.size());
  det_ = 1;
  log_abs_det_ = 0;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    Mat2 u = blocks[i].b, l;
    if (i > 0) {
      l = blocks[i].a * inverse_u_[i - 1];
      u = u - l * blocks[i - 1].c;
    }
    const double d = manifold::det(u);
    if (!(std::abs(d) >= kSingular * norm_squared(blocks[i].b)) || !(std::abs(d) > 0) || !std::isfinite(d))
      return false;
    lower_.push_back(l);
    inverse_u_.push_back(inverse(u));
    upper_.push_back(blocks[i].c);
    det_ *= d;
    log_abs_det_ += math::log(std::abs(d));
  }
  return true;
}

std::vector<Pair> BlockTridiagonal::solve(std::span<const Pair> r) const {
  std::vector<Pair> x(r.begin(), r.end());
  for (std::size_t i = 1; i < size(); ++i) x[i] = x[i] - lower_[i] * x[i - 1];
  for (std::size_t i = size(); i-- > 0;) {
    if (i + 1 < size()) x[i] = x[i] - upper_[i] * x[i + 1];
    x[i] = inverse_u_[i] * x[i];
  }
  return x;
}

std::vector<Mat2> BlockTridiagonal::by_last_end() const {
  std::vector<Mat2> t(size());
  for (std::size_t i = size(); i-- > 0;) {
    t[i] = -(inverse_u_[i] * upper_[i]);
    if (i + 1 < size()) t[i] = t[i] * t[i + 1];
  }
  return t;
}

std::vector<Mat2> BlockTridiagonal::last_vertex_by_constraints() const {
  std::vector<Mat2> d(size());
  for (std::size_t i = size(); i-- > 0;) d[i] = i + 1 == size() ? inverse_u_[i] : -(d[i + 1] * lower_[i + 1]);
  return d;
}

std::vector<Pair> multiply(std::span<const Blocks> blocks, std::span<const Pair> x) {
  std::vector<Pair> out(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    out[i] = blocks[i].b * x[i];
    if (i > 0) out[i] = out[i] + blocks[i].a * x[i - 1];
    if (i + 1 < x.size()) out[i] = out[i] + blocks[i].c * x[i + 1];
  }
  return out;
}

}  // namespace candela::transport::manifold
