#include "worker/scene/thick_medium.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "worker/core/math.h"

namespace candela::scene {
namespace {

constexpr double kExtrapolation = 1.42;

std::array<double, 3> sides(const Bounds& box) {
  if (box.empty()) return {0, 0, 0};
  const Vec3d d = box.high - box.low;
  return {d.x, d.y, d.z};
}
double shortest(const Bounds& box) {
  const auto d = sides(box);
  return *std::min_element(d.begin(), d.end());
}
bool flat(const Bounds& box) {
  const auto d = sides(box);
  return !(shortest(box) > 1e-6 * *std::max_element(d.begin(), d.end()));
}

// For each medium the box that it may fill; empty: without an end.
std::vector<Bounds> boxes(const Media& media, const Geometry& geometry) {
  std::vector<Bounds> largest(media.size()), all(media.size());
  for (std::uint32_t index = 0; index < geometry.shapes.size(); ++index) {
    const std::uint32_t interior = media.interior(geometry.shapes[index].medium_interface);
    if (interior == kNone) continue;
    const Bounds box = geometry.bounds_of_shape(index);
    all[interior].add(box);
    if (shortest(box) > shortest(largest[interior])) largest[interior] = box;
  }
  for (std::size_t i = 0; i < media.size(); ++i)
    if (flat(largest[i])) largest[i] = flat(all[i]) ? Bounds() : all[i];
  return largest;
}

// For one channel.
ThickMedium lasting(double sigma_t, double albedo, double mean_cosine, const Bounds& box) {
  if (box.empty()) return {albedo * albedo, std::numeric_limits<double>::infinity()};
  const double reduced = sigma_t * (1 - mean_cosine);
  double square = 0;
  for (const double side : sides(box)) {
    const double wave = std::numbers::pi / (reduced * side + kExtrapolation);
    square += wave * wave;
  }
  const double b = std::sqrt(square),
               stays =
                   b > 1e-2 ? static_cast<double>(math::atanf(static_cast<float>(b))) / b : 1 - square / 3;
  return {albedo * albedo * math::pow(stays, 1 - mean_cosine), sigma_t * shortest(box)};
}

}  // namespace

ThickMedium thickest_medium(const Media& media, const Geometry& geometry) {
  ThickMedium most;
  const std::vector<Bounds> box = boxes(media, geometry);
  for (std::uint32_t i = 0; i < media.size(); ++i) {
    const Spectrum sigma_t = media[i].max_sigma_t(), albedo = media[i].max_albedo();
    for (const float Spectrum::*channel : {&Spectrum::r, &Spectrum::g, &Spectrum::b}) {
      const auto extinction = static_cast<double>(sigma_t.*channel),
                 scattered = static_cast<double>(albedo.*channel);
      if (!(extinction > 0) || !(scattered > 0)) continue;
      const ThickMedium one =
          lasting(extinction, scattered, static_cast<double>(media[i].phase().mean_cosine()), box[i]);
      if (one.fraction > most.fraction) most = one;
    }
  }
  return most;
}

}  // namespace candela::scene
