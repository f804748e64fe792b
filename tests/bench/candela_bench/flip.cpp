#include "tests/bench/candela_bench/flip.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

namespace candela::bench {
namespace {

using Rgb = std::array<double, 3>;

constexpr double kPixelsPerDegree = 3840 * std::numbers::pi / 180;

// Exponents and the redistribution of [Andersson 2020], sections 4.1 and 4.3.
constexpr double kColourExponent = 0.7, kFeatureExponent = 0.5;
constexpr double kPowerCut = 0.4, kPowerAt = 0.95;
constexpr double kFeatureWidthDegrees = 0.082;

// ACES as the quotient of two quadratics, its pre-exposure of 0.6 within [Andersson 2021].
constexpr std::array<double, 6> kAces = {0.6 * 0.6 * 2.51, 0.6 * 0.03, 0.0,
                                         0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14};
constexpr double kToneOfRange = 0.85;
constexpr double kDarkestMedian = 0x1p-16;  // of the largest luminance

double tone_map(double x) {
  if (!(x > 0)) return 0;  // NaN too
  if (!std::isfinite(x)) return 1;
  const double y =
      (kAces[0] * x * x + kAces[1] * x + kAces[2]) / (kAces[3] * x * x + kAces[4] * x + kAces[5]);
  return std::isfinite(y) ? std::clamp(y, 0.0, 1.0) : 1.0;
}

// The larger x with tone_map(x) = kToneOfRange.
double tone_of_range_inverse() {
  const double t = kToneOfRange;
  const double a = kAces[0] - t * kAces[3], b = kAces[1] - t * kAces[4], c = kAces[2] - t * kAces[5];
  const double half = -0.5 * b / a;
  return half + std::sqrt(half * half - c / a);
}

// Linear Rec.709 and CIE XYZ under D65, as rationals of the primaries.
constexpr double kToXyz[3][3] = {{10135552.0 / 24577794, 8788810.0 / 24577794, 4435075.0 / 24577794},
                                 {2613072.0 / 12288897, 8788810.0 / 12288897, 887015.0 / 12288897},
                                 {1425312.0 / 73733382, 8788810.0 / 73733382, 70074185.0 / 73733382}};
constexpr double kFromXyz[3][3] = {{3.241003275, -1.537398934, -0.498615861},
                                   {-0.969224334, 1.875930071, 0.041554224},
                                   {0.055639423, -0.204011202, 1.057148933}};
constexpr Rgb kWhite = {0.950428545, 1.0, 1.088900371};

Rgb multiply(const double (&m)[3][3], const Rgb& v) {
  Rgb out;
  for (std::size_t i = 0; i < 3; ++i) out[i] = m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2];
  return out;
}

// XYZ over white.
Rgb relative_xyz(const Rgb& linear) {
  Rgb xyz = multiply(kToXyz, linear);
  for (std::size_t i = 0; i < 3; ++i) xyz[i] /= kWhite[i];
  return xyz;
}

Rgb opponent(const Rgb& linear) {
  const Rgb t = relative_xyz(linear);
  return {116 * t[1] - 16, 500 * (t[0] - t[1]), 200 * (t[1] - t[2])};
}

Rgb from_opponent(const Rgb& ycc) {
  const double y = (ycc[0] + 16) / 116;
  const Rgb xyz = {(y + ycc[1] / 500) * kWhite[0], y * kWhite[1], (y - ycc[2] / 200) * kWhite[2]};
  return multiply(kFromXyz, xyz);
}

Rgb hunt_lab(const Rgb& linear) {
  Rgb t = relative_xyz(linear);
  constexpr double kDelta = 6.0 / 29;
  for (double& v : t) v = v > kDelta * kDelta * kDelta ? std::cbrt(v) : v / (3 * kDelta * kDelta) + 4.0 / 29;
  const double lightness = 116 * t[1] - 16;
  return {lightness, 0.01 * lightness * 500 * (t[0] - t[1]), 0.01 * lightness * 200 * (t[1] - t[2])};
}

double hyab(const Rgb& p, const Rgb& q) {
  return std::abs(p[0] - q[0]) + std::hypot(p[1] - q[1], p[2] - q[2]);
}

using Kernel = std::vector<float>;  // of odd length, its middle at the pixel

Plane convolve(const Plane& in, const Kernel& along_x, const Kernel& along_y) {
  const auto width = static_cast<std::int64_t>(in.width), height = static_cast<std::int64_t>(in.height);
  const auto row = [&](std::int64_t y) { return std::clamp<std::int64_t>(y, 0, height - 1) * width; };
  Plane rows{in.width, in.height, std::vector<float>(in.values.size())};
  const auto rx = static_cast<std::int64_t>(along_x.size() / 2);
  std::vector<float> padded(static_cast<std::size_t>(width + 2 * rx));
  for (std::int64_t y = 0; y < height; ++y) {
    const float* const from = in.values.data() + y * width;
    for (std::int64_t x = -rx; x < width + rx; ++x)
      padded[static_cast<std::size_t>(x + rx)] = from[std::clamp<std::int64_t>(x, 0, width - 1)];
    float* const to = rows.values.data() + y * width;
    for (std::size_t k = 0; k < along_x.size(); ++k)
      for (std::int64_t x = 0; x < width; ++x) to[x] += along_x[k] * padded[static_cast<std::size_t>(x) + k];
  }
  Plane out{in.width, in.height, std::vector<float>(in.values.size())};
  const auto ry = static_cast<std::int64_t>(along_y.size() / 2);
  for (std::int64_t y = 0; y < height; ++y)
    for (std::int64_t k = -ry; k <= ry; ++k) {
      const float weight = along_y[static_cast<std::size_t>(k + ry)];
      const float* const from = rows.values.data() + row(y + k);
      float* const to = out.values.data() + y * width;
      for (std::int64_t x = 0; x < width; ++x) to[x] += weight * from[x];
    }
  return out;
}

// A sum of Gaussians a sqrt(pi / b) exp(-pi^2 r^2 / b), r in degrees, whose weights sum to one.
struct Gaussian {
  double a, b;
};
Plane sensitivity_filter(const Plane& in, std::span<const Gaussian> gaussians) {
  constexpr double kPi = std::numbers::pi;
  constexpr double kWidest = 0.04;  // the largest b of all channels decides the radius of all
  const int radius = static_cast<int>(std::ceil(3 * std::sqrt(kWidest / (2 * kPi * kPi)) * kPixelsPerDegree));
  std::vector<std::vector<double>> kernels;
  double total = 0;
  for (const Gaussian& g : gaussians) {
    std::vector<double> kernel;
    for (int x = -radius; x <= radius; ++x) {
      const double degrees = x / kPixelsPerDegree;
      kernel.push_back(std::exp(-kPi * kPi * degrees * degrees / g.b));
    }
    const double sum = std::accumulate(kernel.begin(), kernel.end(), 0.0);
    total += g.a * std::sqrt(kPi / g.b) * sum * sum;
    kernels.push_back(std::move(kernel));
  }
  Plane out{in.width, in.height, std::vector<float>(in.values.size())};
  for (std::size_t i = 0; i < kernels.size(); ++i) {
    const double scale = std::sqrt(gaussians[i].a * std::sqrt(kPi / gaussians[i].b) / total);
    Kernel kernel;
    for (const double value : kernels[i]) kernel.push_back(static_cast<float>(value * scale));
    const Plane part = convolve(in, kernel, kernel);
    for (std::size_t p = 0; p < out.values.size(); ++p) out.values[p] += part.values[p];
  }
  return out;
}

// Magnitude of the response to the first (edges) or second (points) derivative of a Gaussian along x and y,
// positive and negative weights each summing to one.
Plane features(const Plane& achromatic, bool points) {
  const double deviation = 0.5 * kFeatureWidthDegrees * kPixelsPerDegree;
  const int radius = static_cast<int>(std::ceil(3 * deviation));
  Kernel derivative, smooth;
  double positive = 0, negative = 0, sum = 0;
  const auto weight = [&](double x) {
    const double g = std::exp(-x * x / (2 * deviation * deviation));
    return points ? (x * x / (deviation * deviation) - 1) * g : -x * g;
  };
  const auto gaussian = [&](double x) { return std::exp(-x * x / (2 * deviation * deviation)); };
  for (int x = -radius; x <= radius; ++x) {
    (weight(x) > 0 ? positive : negative) += weight(x);
    sum += gaussian(x);
  }
  for (int x = -radius; x <= radius; ++x) {
    derivative.push_back(static_cast<float>(weight(x) / (weight(x) > 0 ? positive : -negative)));
    smooth.push_back(static_cast<float>(gaussian(x) / sum));
  }
  Plane x = convolve(achromatic, derivative, smooth);
  const Plane y = convolve(achromatic, smooth, derivative);
  for (std::size_t p = 0; p < x.values.size(); ++p) x.values[p] = std::hypot(x.values[p], y.values[p]);
  return x;
}

constexpr std::array<Gaussian, 1> kAchromatic = {{{1, 0.0047}}};
constexpr std::array<Gaussian, 1> kRedGreen = {{{1, 0.0053}}};
constexpr std::array<Gaussian, 2> kBlueYellow = {{{34.1, 0.04}, {13.5, 0.025}}};

// `at(i)`: value i in [0, 1].
template <class At>
FlipView make_view(std::uint32_t width, std::uint32_t height, const At& at) {
  const std::size_t pixels = std::size_t{width} * height;
  std::array<Plane, 3> planes;
  for (Plane& plane : planes) plane = {width, height, std::vector<float>(pixels)};
  Plane achromatic{width, height, std::vector<float>(pixels)};
  for (std::size_t p = 0; p < pixels; ++p) {
    const Rgb ycc = opponent({at(3 * p), at(3 * p + 1), at(3 * p + 2)});
    for (std::size_t c = 0; c < 3; ++c) planes[c].values[p] = static_cast<float>(ycc[c]);
    achromatic.values[p] = static_cast<float>((ycc[0] + 16) / 116);
  }
  planes = {sensitivity_filter(planes[0], kAchromatic), sensitivity_filter(planes[1], kRedGreen),
            sensitivity_filter(planes[2], kBlueYellow)};
  for (std::size_t p = 0; p < pixels; ++p) {
    Rgb linear = from_opponent({planes[0].values[p], planes[1].values[p], planes[2].values[p]});
    for (double& value : linear) value = std::clamp(value, 0.0, 1.0);
    const Rgb lab = hunt_lab(linear);
    for (std::size_t c = 0; c < 3; ++c) planes[c].values[p] = static_cast<float>(lab[c]);
  }
  return {std::move(planes[0]), std::move(planes[1]), std::move(planes[2]), features(achromatic, false),
          features(achromatic, true)};
}

// Into [0, 1], kPowerAt at kPowerCut of the largest difference there is (pure green and blue).
double redistribute(double colour_difference) {
  static const double largest = std::pow(hyab(hunt_lab({0, 1, 0}), hunt_lab({0, 0, 1})), kColourExponent);
  const double power = std::pow(colour_difference, kColourExponent);
  const double cut = kPowerCut * largest;
  return power < cut ? kPowerAt / cut * power : kPowerAt + (power - cut) / (largest - cut) * (1 - kPowerAt);
}

void raise_to_difference(const FlipView& r, const FlipView& t, std::vector<float>& map) {
  for (std::size_t p = 0; p < map.size(); ++p) {
    const double colour = redistribute(hyab({r.lightness.values[p], r.a.values[p], r.b.values[p]},
                                            {t.lightness.values[p], t.a.values[p], t.b.values[p]}));
    const double edge = std::abs(static_cast<double>(r.edges.values[p]) - t.edges.values[p]);
    const double point = std::abs(static_cast<double>(r.points.values[p]) - t.points.values[p]);
    const double feature =
        std::pow(std::min(1.0, std::max(edge, point) / std::numbers::sqrt2), kFeatureExponent);
    map[p] = std::max(map[p], static_cast<float>(std::pow(colour, 1 - feature)));
  }
}

FlipView exposed_view(std::span<const float> image, std::uint32_t width, std::uint32_t height, double stops) {
  const double factor = std::exp2(stops);
  return make_view(width, height, [&](std::size_t i) { return tone_map(factor * image[i]); });
}

}  // namespace

Flip::Flip(std::span<const float> reference, std::uint32_t width, std::uint32_t height)
    : width_(width), height_(height) {
  std::vector<double> luminances;
  for (std::size_t i = 0; i + 2 < reference.size(); i += 3) {
    const double y = kToXyz[1][0] * std::max(0.0F, reference[i]) +
                     kToXyz[1][1] * std::max(0.0F, reference[i + 1]) +
                     kToXyz[1][2] * std::max(0.0F, reference[i + 2]);
    if (std::isfinite(y)) luminances.push_back(y);
  }
  std::sort(luminances.begin(), luminances.end());
  const double largest = luminances.empty() ? 0 : luminances.back();
  if (!(largest > 0)) {
    exposures_ = {0};  // a black reference has no range
  } else {
    const std::size_t n = luminances.size();
    const double median =
        std::max((luminances[(n - 1) / 2] + luminances[n / 2]) / 2, kDarkestMedian * largest);
    const double start = std::log2(tone_of_range_inverse() / largest);
    const double stop = std::log2(tone_of_range_inverse() / median);
    const int count = std::max(2, static_cast<int>(std::ceil(stop - start)));
    for (int i = 0; i < count; ++i) exposures_.push_back(start + i * (stop - start) / (count - 1));
  }
  for (const double stops : exposures_) reference_.push_back(exposed_view(reference, width, height, stops));
}

std::vector<float> Flip::map(std::span<const float> image) const {
  std::vector<float> map(std::size_t{width_} * height_);
  for (std::size_t i = 0; i < exposures_.size(); ++i)
    raise_to_difference(reference_[i], exposed_view(image, width_, height_, exposures_[i]), map);
  return map;
}

double Flip::mean(std::span<const float> image) const {
  const std::vector<float> values = map(image);
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

std::vector<float> ldr_flip(std::span<const float> reference, std::span<const float> image,
                            std::uint32_t width, std::uint32_t height) {
  std::vector<float> map(std::size_t{width} * height);
  const auto view = [&](std::span<const float> of) {
    return make_view(width, height, [&](std::size_t i) { return std::clamp<double>(of[i], 0, 1); });
  };
  raise_to_difference(view(reference), view(image), map);
  return map;
}

}  // namespace candela::bench
