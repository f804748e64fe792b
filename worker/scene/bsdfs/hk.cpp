#include "worker/scene/bsdfs/hk.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "worker/core/math.h"
#include "worker/scene/bsdfs/kinds.h"
#include "worker/scene/media/medium.h"

namespace candela::scene {
namespace {

// exp(-x) for x >= 0, also an infinite one.
double decayed(double x) {
  return x < 700 ? math::exp(-x) : 0.0;
}

// (1 - exp(-x)) / x for x >= 0.
double mean_decay(double x) {
  return x < 1e-5 ? 1 - 0.5 * x : (1 - decayed(x)) / x;
}

// f / (albedo p)
float single_reflection(double tau, double c_o, double c_i) {
  const double path = 1 / c_i + 1 / c_o;
  return static_cast<float>((1 - decayed(tau * path)) / (c_i + c_o));
}
float single_transmission(double tau, double c_o, double c_i) {
  if (c_i < c_o) std::swap(c_i, c_o);
  // exp(-tau / c_i) (1 - exp(-tau d)) / (c_i - c_o) with d = 1 / c_o - 1 / c_i = (c_i - c_o) / (c_i c_o)
  const double d = (c_i - c_o) / (c_i * c_o);
  return static_cast<float>(decayed(tau / c_i) * mean_decay(tau * d) * tau / (c_i * c_o));
}

// The probability of passing straight on. A layer that lets next to nothing through has a sixteenth, so that
// the weight of what does pass stays small.
float prob_passthrough(const LayerClosure& p, Vec3 wo) {
  const Spectrum passing = passthrough(p, wo);
  if (passing.is_black()) return 0;
  const float mean = (passing.r + passing.g + passing.b) / 3;
  return std::min(1.0f, 0.0625f + 0.9375f * mean);
}

}  // namespace

Spectrum passthrough(const LayerClosure& p, Vec3 wo) {
  const double cosine = std::abs(static_cast<double>(wo.z));
  if (!(cosine > 0)) return {};
  const auto passing = [&](float tau) {
    return static_cast<float>(decayed(static_cast<double>(tau) / cosine));
  };
  return {passing(p.tau.r), passing(p.tau.g), passing(p.tau.b)};
}

Spectrum eval_pdf(const LayerClosure& p, Vec3 wo, Vec3 wi, TransportMode /*mode*/, float& pdf) {
  pdf = 0;
  const double c_o = std::abs(static_cast<double>(wo.z)), c_i = std::abs(static_cast<double>(wi.z));
  if (!(c_o > 0 && c_i > 0)) return {};
  const float phase = p.phase.eval(wo, wi);
  pdf = (1 - prob_passthrough(p, wo)) * phase;
  const bool reflects = wo.z * wi.z > 0;
  const auto channel = [&](float tau) {
    return reflects ? single_reflection(static_cast<double>(tau), c_o, c_i)
                    : single_transmission(static_cast<double>(tau), c_o, c_i);
  };
  return p.albedo * Spectrum(channel(p.tau.r), channel(p.tau.g), channel(p.tau.b)) * (phase * std::abs(wi.z));
}

bool sample(const LayerClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out) {
  if (wo.z == 0) return false;
  const float prob = prob_passthrough(p, wo);
  if (u_lobe < prob) {
    out.wi = -wo;
    out.delta = true;
    out.transmitted = true;
    out.passthrough = true;
    out.prob = out.prob_reverse = prob;
    out.weight = passthrough(p, wo) * (1 / prob);
    return true;
  }
  static_cast<void>(p.phase.sample(wo, u, out.wi));
  const Spectrum value = eval_pdf(p, wo, out.wi, mode, out.pdf_solid_angle);
  if (!(out.pdf_solid_angle > kMinDensity)) return false;
  out.weight = value * (1 / out.pdf_solid_angle);
  out.transmitted = wo.z * out.wi.z < 0;
  return true;
}

Result<void> LayerSurface::build(const description::Object& object, const BuildContext& context) {
  by_albedo = !given(object, "sigma_s") && !given(object, "sigma_a");
  const Spectrum one(1.0f);
  CANDELA_ASSIGN(first, context.textures.color(object, by_albedo ? "sigma_t" : "sigma_s", one));
  CANDELA_ASSIGN(second, by_albedo ? read_reflectance(object, context.textures, "albedo", 0.75f)
                                   : context.textures.color(object, "sigma_a", Spectrum()));
  thickness = static_cast<float>(object.get_number("thickness", 1));
  if (!(thickness >= 0) || !std::isfinite(thickness))
    return located("the thickness is finite and not negative", object, "thickness");
  CANDELA_ASSIGN(phase, build_phase(object));
  return {};
}

void LayerSurface::prepare(const SurfacePoint& at, bool /*below*/, Closure& out) const {
  LayerClosure p = {};
  const Spectrum a = first.eval(at), b = second.eval(at);
  const auto albedo = [](float scattered, float absorbed) {
    return scattered > 0 ? scattered / (scattered + absorbed) : 0.0f;
  };
  p.albedo = by_albedo ? b : Spectrum(albedo(a.r, b.r), albedo(a.g, b.g), albedo(a.b, b.b));
  p.tau = (by_albedo ? a : a + b) * thickness;
  p.phase = phase;
  out.set(p);
}

BsdfFacts LayerSurface::facts() const {
  const bool scatters =
      thickness > 0 && !first.maximum().is_black() && !(by_albedo && second.maximum().is_black());
  return {.smooth = scatters, .transmissive = scatters, .passthrough = true, .max_albedo = 1};
}

}  // namespace candela::scene
