#include "worker/scene/media/medium.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "worker/core/math.h"

namespace candela::scene {
namespace {

// Grids thicker than this along their longest line would take a ray that many steps.
constexpr double kThickest = 1e7;

using Channels = std::array<double, 3>;

Channels to_array(Spectrum s) {
  return {static_cast<double>(s.r), static_cast<double>(s.g), static_cast<double>(s.b)};
}

// The probability of each channel to choose the distance.
Channels shares(Spectrum channels) {
  const Channels c = to_array(channels);
  const double sum = c[0] + c[1] + c[2];
  if (!(sum > 0) || !std::isfinite(sum)) return {1.0 / 3, 1.0 / 3, 1.0 / 3};
  return {c[0] / sum, c[1] / sum, c[2] / sum};
}

// exp(-sigma distance) per channel, where a distance without end passes only what has no extinction at all.
Channels transmitted(Spectrum sigma_t, float distance) {
  const Channels sigma = to_array(sigma_t);
  Channels t{};
  for (std::size_t i = 0; i < 3; ++i)
    t[i] =
        i > 0 && sigma[i] == sigma[i - 1] ? t[i - 1] : math::exp(-sigma[i] * static_cast<double>(distance));
  return t;
}

double mixture(const Channels& share, const Channels& value) {
  return share[0] * value[0] + share[1] * value[1] + share[2] * value[2];
}

Spectrum over(const Channels& value, double divisor) {
  return {static_cast<float>(value[0] / divisor), static_cast<float>(value[1] / divisor),
          static_cast<float>(value[2] / divisor)};
}

}  // namespace

Medium::Medium(Volume sigma_t, float scale, Volume albedo, Phase phase)
    : sigma_t_(sigma_t.constant * scale), albedo_(std::move(albedo)), phase_(phase) {
  max_albedo_ = albedo_.maximum();
  if (sigma_t.grid != nullptr) {
    tracking_ = std::make_shared<Tracking>(std::move(sigma_t.grid), scale);
    max_sigma_t_ = tracking_->maximum();
  } else {
    max_sigma_t_ = sigma_t_;
    gray_ = sigma_t_.r == sigma_t_.g && sigma_t_.g == sigma_t_.b;
  }
}

Spectrum Medium::sigma_t(Vec3 p) const {
  return tracking_ == nullptr ? sigma_t_ : tracking_->sigma_t(Vec3d(p));
}

Spectrum Medium::sigma_t_inside(Vec3 p) const {
  return tracking_ == nullptr ? sigma_t_ : tracking_->sigma_t_inside(Vec3d(p));
}

DistanceSample Medium::sample_homogeneous(float t_max, Spectrum channels, Vec2 u, const Ray& ray) const {
  DistanceSample out;
  const Channels sigma = to_array(sigma_t_), share = gray_ ? Channels{} : shares(channels);
  std::size_t chosen = 0;
  double rest = static_cast<double>(u.x);  // what the choice of the channel leaves of u.x, uniform again
  if (!gray_) {
    double before = 0;
    while (chosen < 2 && rest >= before + share[chosen]) before += share[chosen++];
    while (share[chosen] == 0) --chosen;  // only where rounding led beyond the last
    rest = std::clamp((rest - before) / share[chosen], 0.0, 1.0 - 0x1p-28);
  }
  // The draw of the distance gets the rest as its lower bits: 24 bits end at 17 mean free paths. It stays
  // above 0.
  const double left = 1 - (static_cast<double>(u.y) + rest * 0x1p-24);
  const double t = sigma[chosen] > 0 ? -math::log(left) / sigma[chosen] : 1e300;
  out.scattered = t < static_cast<double>(t_max);
  if (out.scattered) {
    out.distance = static_cast<float>(t);
    out.weight = albedo_.eval(Vec3d(ray.origin) + Vec3d(ray.direction) * t);
    if (gray_) return out;
    Channels density = transmitted(sigma_t_, out.distance);
    for (std::size_t i = 0; i < 3; ++i) density[i] *= sigma[i];
    out.weight *= over(density, mixture(share, density));
  } else if (gray_) {
    out.weight = Spectrum(1);
  } else {
    const Channels pass = transmitted(sigma_t_, t_max);
    out.weight = over(pass, mixture(share, pass));
  }
  return out;
}

float Medium::pdf_distance(float distance, Spectrum channels) const {
  const Channels sigma = to_array(sigma_t_);
  Channels density = transmitted(sigma_t_, distance);
  for (std::size_t i = 0; i < 3; ++i) density[i] *= sigma[i];
  return static_cast<float>(mixture(shares(channels), density));
}

float Medium::prob_pass(float distance, Spectrum channels) const {
  return Stretch(*this, distance).prob_pass(channels);
}

Medium::Stretch::Stretch(const Medium& medium, float length)
    : passes_(transmitted(medium.sigma_t_, length)), gray_(medium.gray_) {}

Spectrum Medium::Stretch::transmittance() const {
  return over(passes_, 1);
}

float Medium::Stretch::prob_pass(Spectrum channels) const {
  return static_cast<float>(gray_ ? passes_[0] : mixture(shares(channels), passes_));
}

DistanceSample Medium::sample_distance(const Ray& ray, Spectrum channels, Vec2 u,
                                       std::vector<FlightStep>* steps) const {
  if (tracking_ == nullptr) return sample_homogeneous(ray.t_max, channels, u, ray);
  DistanceSample out;
  rng::Stream stream(rng::key(std::bit_cast<std::uint32_t>(u.x), std::bit_cast<std::uint32_t>(u.y)));
  const Channels share = shares(channels);
  double t = 0;
  out.scattered = tracking_->collide(ray, over(share, 1), stream, t, out.weight, steps);
  if (out.scattered) {
    out.distance = static_cast<float>(t);
    out.weight *= albedo_.eval(Vec3d(ray.origin) + Vec3d(ray.direction) * t);
  }
  return out;
}

Spectrum Medium::transmittance(const Ray& ray, rng::Stream& stream) const {
  if (tracking_ != nullptr) return tracking_->transmittance(ray, stream);
  return Stretch(*this, ray.t_max).transmittance();
}

namespace {

Error error_at(const description::Object& object, std::string_view field, std::string message) {
  return input_error(std::move(message))
      .at(object.where.file, object.where.line)
      .with_field(std::string(field));
}

Result<Phase> phase_of(const description::Object& object) {
  if (object.plugin == "hg") return Phase::henyey_greenstein(static_cast<float>(object.get_number("g", 0.8)));
  if (object.plugin == "rayleigh") return Phase::rayleigh();
  if (object.plugin != "blendphase") return Phase();
  const auto parts = object.children_of("phase");
  if (parts.size() != 2) return error_at(object, "phase", "a blendphase holds two phase functions");
  CANDELA_ASSIGN(const Phase first, phase_of(*parts[0]));
  CANDELA_ASSIGN(const Phase second, phase_of(*parts[1]));
  Phase blend;
  if (!Phase::blend(first, second, static_cast<float>(object.get_number("weight", 0.5)), blend))
    return error_at(object, "phase", "a blendphase is made of more than 4 phase functions");
  return blend;
}

}  // namespace

Result<Phase> build_phase(const description::Object& owner) {
  const auto phases = owner.children_of("phase");
  if (phases.empty()) return Phase();
  return phase_of(*phases[0]);
}

Result<Medium> build_medium(const description::Object& object, const description::FileSource& files) {
  CANDELA_ASSIGN(Volume sigma_t, Volume::build(object, "sigma_t", 1, files));
  CANDELA_ASSIGN(Volume albedo, Volume::build(object, "albedo", 0.75, files));
  if (albedo.maximum().max_component() > 1)
    return error_at(object, "albedo", "the albedo is above 1 somewhere: the medium would make light");
  const auto scale = static_cast<float>(object.get_number("scale", 1));
  CANDELA_ASSIGN(const Phase phase, build_phase(object));
  const bool grid = sigma_t.grid != nullptr;
  const double longest = grid ? sigma_t.grid->longest_line() : 0;
  Medium medium(std::move(sigma_t), scale, std::move(albedo), phase);
  const double most = static_cast<double>(medium.max_sigma_t().max_component());
  if (!std::isfinite(most)) return error_at(object, "sigma_t", "sigma_t times scale is too large");
  if (grid && longest * most > kThickest) {
    return error_at(object, "scale",
                    "the grid is more than 1e7 mean free paths thick: nothing inside would be seen")
        .with_mend("lower the scale, or bound a homogeneous medium by its surface");
  }
  return medium;
}

}  // namespace candela::scene
