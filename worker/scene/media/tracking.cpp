#include "worker/scene/media/tracking.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "worker/core/math.h"

namespace candela::scene {
namespace {

constexpr std::uint32_t kGridCells = 4;  // of the grid along an axis to one coarse cell, up to
constexpr std::uint32_t kMaxCells = 64;  // coarse cells along an axis
// Interpolation in float may exceed the largest of its eight values by rounding.
constexpr float kRounding = 1 + 1e-6f;
constexpr float kRoulette = 0.1f;  // a transmittance below this may end
constexpr double kOpaque = 200;    // an optical thickness that nothing passes: exp(-200) = 1e-87

double exponential(rng::Stream& stream) {
  return -math::log(1 - stream.next_double());
}

Spectrum clamped(Spectrum s) {
  return {std::max(s.r, 0.0f), std::max(s.g, 0.0f), std::max(s.b, 0.0f)};
}
float sum(Spectrum s) {
  return s.r + s.g + s.b;
}

// The part of a line through local space that lies in the unit cube, widened by `margin` on all sides. False:
// none of [begin, end].
bool clip(Vec3d origin, Vec3d direction, double margin, double& begin, double& end) {
  for (int axis = 0; axis < 3; ++axis) {
    const double o = origin[axis], d = direction[axis];
    if (d == 0) {
      if (!(o >= -margin && o <= 1 + margin)) return false;
      continue;
    }
    const double a = (-margin - o) / d, b = (1 + margin - o) / d;
    begin = std::max(begin, std::min(a, b));
    end = std::min(end, std::max(a, b));
  }
  return begin < end;
}

}  // namespace

Spectrum weight_at(std::span<const FlightStep> steps, float distance) {
  const auto after = std::upper_bound(steps.begin(), steps.end(), distance,
                                      [](float at, const FlightStep& step) { return at < step.distance; });
  return after == steps.begin() ? Spectrum(1) : std::prev(after)->weight;
}

// In local space, where the grid is [0, 1]^3. Distances have the world's scale and are counted from where the
// ray enters the grid: from far away the steps between collisions in a dense and tiny grid would be lost to
// rounding, and the walk would stand still.
class Tracking::Walk {
 public:
  Walk(const Tracking& tracking, const Ray& ray)
      : tracking_(tracking),
        origin_(tracking.grid_->to_local(Vec3d(ray.origin))),
        direction_(tracking.grid_->to_local_vector(Vec3d(ray.direction))) {
    double begin = 0, end = static_cast<double>(ray.t_max);
    if (!clip(origin_, direction_, 0, begin, end)) return;
    entry_ = begin;
    end_ = end - begin;
    origin_ += direction_ * begin;
    for (int axis = 0; axis < 3; ++axis) {
      const auto k = static_cast<std::size_t>(axis);
      const double n = tracking.size_[k], x = origin_[axis] * n;
      index_[k] = static_cast<std::int64_t>(std::clamp(std::floor(x), 0.0, n - 1));
      const double d = direction_[axis];
      step_[k] = d > 0 ? 1 : -1;
      next_[k] = d == 0 ? std::numeric_limits<double>::infinity() : wall(k, axis);
    }
  }

  bool inside() const { return t_ < end_; }
  double entry() const { return entry_; }  // the ray's distance at the walk's zero
  double t() const { return t_; }
  const Cell& cell() const {
    const auto& n = tracking_.size_;
    return tracking_
        .cells_[(static_cast<std::size_t>(index_[2]) * n[1] + static_cast<std::size_t>(index_[1])) * n[0] +
                static_cast<std::size_t>(index_[0])];
  }
  // Distance at which the ray leaves the cell.
  double exit() const { return std::min(std::min(next_[0], next_[1]), std::min(next_[2], end_)); }
  void leave_cell() {
    const std::size_t k =
        next_[0] <= next_[1] ? (next_[0] <= next_[2] ? 0 : 2) : (next_[1] <= next_[2] ? 1 : 2);
    t_ = std::max(t_, std::min(next_[k], end_));
    if (!(next_[k] < end_)) {
      t_ = end_;
      return;
    }
    index_[k] += step_[k];
    if (index_[k] < 0 || index_[k] >= static_cast<std::int64_t>(tracking_.size_[k])) {
      t_ = end_;
      return;
    }
    next_[k] = wall(k, static_cast<int>(k));
  }
  Spectrum sigma_t(double t) const {
    return tracking_.grid_->eval(origin_ + direction_ * t) * tracking_.scale_;
  }

 private:
  double wall(std::size_t k, int axis) const {
    const double at = static_cast<double>(index_[k] + (step_[k] > 0 ? 1 : 0)) / tracking_.size_[k];
    return (at - origin_[axis]) / direction_[axis];
  }

  const Tracking& tracking_;
  Vec3d origin_, direction_;
  std::array<std::int64_t, 3> index_{}, step_{};
  std::array<double, 3> next_{};
  double entry_ = 0, t_ = 0, end_ = 0;
};

Tracking::Tracking(std::shared_ptr<const GridVolume> grid, float scale)
    : grid_(std::move(grid)), scale_(scale) {
  for (std::size_t k = 0; k < 3; ++k)
    size_[k] = std::min((grid_->size()[k] + kGridCells - 1) / kGridCells, kMaxCells);
  cells_.reserve(std::size_t{size_[0]} * size_[1] * size_[2]);
  for (std::uint32_t z = 0; z < size_[2]; ++z)
    for (std::uint32_t y = 0; y < size_[1]; ++y)
      for (std::uint32_t x = 0; x < size_[0]; ++x) {
        const Vec3d n(size_[0], size_[1], size_[2]);
        Spectrum least, most;
        grid_->bounds({x / n.x, y / n.y, z / n.z}, {(x + 1) / n.x, (y + 1) / n.y, (z + 1) / n.z}, least,
                      most);
        least = least * (scale_ / kRounding);
        most = most * (scale_ * kRounding);
        cells_.push_back({least, most.max_component(), (most - least).max_component()});
      }
}

Spectrum Tracking::sigma_t_inside(Vec3d world) const {
  const Vec3d p = grid_->to_local(world);
  for (int axis = 0; axis < 3; ++axis)
    if (!(p[axis] >= 0 && p[axis] <= 1)) return {};
  return grid_->eval(p) * scale_;
}

float Tracking::distance_to_end(const Ray& ray, double margin) const {
  double begin = 0, end = static_cast<double>(ray.t_max);
  const Vec3d origin = grid_->to_local(Vec3d(ray.origin)),
              direction = grid_->to_local_vector(Vec3d(ray.direction));
  return clip(origin, direction, margin, begin, end) ? static_cast<float>(end) : 0.0f;
}

bool Tracking::collide(const Ray& ray, Spectrum channels, rng::Stream& stream, double& t, Spectrum& weight,
                       std::vector<FlightStep>* steps) const {
  weight = Spectrum(1);
  if (grid_->gray()) steps = nullptr;
  double thickness = exponential(stream);  // until the next tentative collision
  for (Walk walk(*this, ray); walk.inside(); walk.leave_cell()) {
    const Cell& cell = walk.cell();
    const auto most = static_cast<double>(cell.most);
    t = walk.t();
    for (const double exit = walk.exit();;) {
      const double rest = most * (exit - t);
      if (!(thickness < rest)) {
        thickness -= std::max(rest, 0.0);
        break;
      }
      t += thickness / most;
      thickness = exponential(stream);
      const Spectrum sigma_t = walk.sigma_t(t);
      const Spectrum sigma_n = clamped(Spectrum(cell.most) - sigma_t);
      const Spectrum counts = channels * weight;
      const float real = sum(counts * sigma_t), null = sum(counts * sigma_n);
      if (!(real + null > 0)) return false;
      const float prob = real / (real + null);
      const bool collided = stream.next_double() < static_cast<double>(prob);
      weight *= collided ? sigma_t * (1 / (cell.most * prob)) : sigma_n * (1 / (cell.most * (1 - prob)));
      if (collided) {
        t += walk.entry();
        return true;
      }
      if (steps != nullptr) steps->push_back({static_cast<float>(t + walk.entry()), weight});
    }
  }
  return false;
}

Spectrum Tracking::transmittance(const Ray& ray, rng::Stream& stream) const {
  Spectrum ratio(1);
  Vec3d control;  // optical thickness in closed form, per channel
  double thickness = exponential(stream);
  for (Walk walk(*this, ray); walk.inside(); walk.leave_cell()) {
    const Cell& cell = walk.cell();
    const auto residual = static_cast<double>(cell.residual);
    const double exit = walk.exit(), length = std::max(exit - walk.t(), 0.0);
    control += Vec3d(static_cast<double>(cell.least.r), static_cast<double>(cell.least.g),
                     static_cast<double>(cell.least.b)) *
               length;
    if (std::min(control.x, std::min(control.y, control.z)) > kOpaque) return {};
    for (double t = walk.t();;) {
      const double rest = residual * (exit - t);
      if (!(thickness < rest)) {
        thickness -= std::max(rest, 0.0);
        break;
      }
      t += thickness / residual;
      thickness = exponential(stream);
      ratio *= clamped(Spectrum(1) - clamped(walk.sigma_t(t) - cell.least) * (1 / cell.residual));
      const float left = ratio.max_component();
      if (left < kRoulette) {
        const float survive = left / kRoulette;
        if (!(stream.next_double() < static_cast<double>(survive))) return {};
        ratio *= 1 / survive;
      }
    }
  }
  return ratio * Spectrum(static_cast<float>(math::exp(-control.x)),
                          static_cast<float>(math::exp(-control.y)),
                          static_cast<float>(math::exp(-control.z)));
}

}  // namespace candela::scene
