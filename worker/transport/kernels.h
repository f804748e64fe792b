// Kernels that blur the meeting of a light and an eye subpath over a line (two beams in a medium; densities
// per length), a disc (vertices on surfaces, or a point and a beam; per area) or a ball (vertices in media;
// per volume) of radius r. Each integrates to one there; a line reaches from -r to r.
//
//   t = distance / r                     line: 1 / mass, int K^2   disc                      ball
//   constant      1                        1/2, 1/2       1 / pi,     1 / pi           3 / (4 pi),   3 / (4
//   pi) epanechnikov  1 - t^2                  3/4, 3/5       2 / pi,     4 / (3 pi)       15 / (8 pi),  15 /
//   (14 pi) perlin  1 - 10 t^3 + 15 t^4 - 6 t^5    1, 181/231     7 / (2 pi), 287 / (132 pi)   21 / (5 pi),
//   1498 / (715 pi)
//
// for r = 1; masses grow with r (line), r^2 (disc) and r^3 (ball), int K^2 falls with them.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

namespace candela::transport {

enum class Kernel : std::uint8_t { constant, epanechnikov, perlin };

namespace detail {

// Not normalized; d2 is the squared distance, inv_r2 = 1 / r^2. Zero at t = 1 but for the constant one.
inline float kernel_profile(Kernel kernel, float d2, float inv_r2) {
  if (kernel == Kernel::constant) return 1;
  const float t2 = d2 * inv_r2;
  if (!(t2 < 1)) return 0;
  if (kernel == Kernel::epanechnikov) return 1 - t2;
  const float t = std::sqrt(t2);
  // 1 - 10 t^3 + 15 t^4 - 6 t^5 [Perlin 2002], with the zero of third order at t = 1 split off: no
  // cancellation there.
  const float s = 1 - t;
  return s * s * s * (1 + 3 * t + 6 * t2);
}

inline constexpr double kLineNorm[] = {0.5, 0.75, 1};
inline constexpr double kDiscNorm[] = {std::numbers::inv_pi, 2 * std::numbers::inv_pi,
                                       3.5 * std::numbers::inv_pi};
inline constexpr double kBallNorm[] = {0.75 * std::numbers::inv_pi, 1.875 * std::numbers::inv_pi,
                                       4.2 * std::numbers::inv_pi};
// 1 / int K^2 for r = 1.
inline constexpr double kLineVolume[] = {2, 5.0 / 3, 231.0 / 181};
inline constexpr double kDiscVolume[] = {std::numbers::pi, 0.75 * std::numbers::pi,
                                         132 * std::numbers::pi / 287};
inline constexpr double kBallVolume[] = {4 * std::numbers::pi / 3, 14 * std::numbers::pi / 15,
                                         715 * std::numbers::pi / 1498};

}  // namespace detail

// A kernel of one radius > 0, over the line. 1 / r^2 has to be finite in float: r of 1e-19 to 1e19.
class LineKernel {
 public:
  LineKernel(Kernel kernel, float radius)
      : kernel_(kernel),
        inv_r2_(static_cast<float>(1 / (static_cast<double>(radius) * static_cast<double>(radius)))),
        scale_(
            static_cast<float>(detail::kLineNorm[static_cast<int>(kernel)] / static_cast<double>(radius))) {}
  // 1 / length, at the squared distance d2 <= r^2, as for the disc.
  float value(float d2) const { return scale_ * detail::kernel_profile(kernel_, d2, inv_r2_); }

 private:
  Kernel kernel_;
  float inv_r2_, scale_;
};

// A kernel of one radius > 0, over the disc. 1 / r^2 has to be finite in float: r of 1e-19 to 1e19.
class DiscKernel {
 public:
  DiscKernel(Kernel kernel, float radius)
      : kernel_(kernel),
        inv_r2_(static_cast<float>(1 / (static_cast<double>(radius) * static_cast<double>(radius)))),
        scale_(static_cast<float>(detail::kDiscNorm[static_cast<int>(kernel)] /
                                  (static_cast<double>(radius) * static_cast<double>(radius)))) {}
  // 1 / area, at the squared distance d2 <= r^2; whether d2 is so is the range search's to say, so that the
  // constant kernel has the same value at all it finds.
  float value(float d2) const { return scale_ * detail::kernel_profile(kernel_, d2, inv_r2_); }

 private:
  Kernel kernel_;
  float inv_r2_, scale_;
};

// The same over the ball, 1 / volume. 1 / r^3 has to be finite in float: r of 1e-12 to 1e12.
class BallKernel {
 public:
  BallKernel(Kernel kernel, float radius)
      : kernel_(kernel),
        inv_r2_(static_cast<float>(1 / (static_cast<double>(radius) * static_cast<double>(radius)))),
        scale_(static_cast<float>(
            detail::kBallNorm[static_cast<int>(kernel)] /
            (static_cast<double>(radius) * static_cast<double>(radius) * static_cast<double>(radius)))) {}
  float value(float d2) const { return scale_ * detail::kernel_profile(kernel_, d2, inv_r2_); }

 private:
  Kernel kernel_;
  float inv_r2_, scale_;
};

// V = 1 / int K^2: the length (line), area (disc) or volume (ball) that stands for a merge in the extended
// balance heuristic, pdf_merge = pdf_light pdf_eye V [Krivanek 2014]; 2 r, pi r^2 and 4/3 pi r^3 for the
// constant kernel.
inline double effective_length(Kernel kernel, double radius) {
  return detail::kLineVolume[static_cast<int>(kernel)] * radius;
}
inline double effective_area(Kernel kernel, double radius) {
  return detail::kDiscVolume[static_cast<int>(kernel)] * radius * radius;
}
inline double effective_volume(Kernel kernel, double radius) {
  return detail::kBallVolume[static_cast<int>(kernel)] * radius * radius * radius;
}

}  // namespace candela::transport
