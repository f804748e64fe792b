// The oracle's contribution of a path, and the densities with which walks truly make it.
#include <algorithm>

#include "worker/core/math.h"
#include "worker/scene/bsdfs/delta_lobes.h"
#include "worker/transport/path/evaluation.h"

namespace candela::transport::path {
namespace {

using Channels = std::array<double, 3>;

Spectrum spectrum(const Channels& c) {
  const double largest = std::max({c[0], c[1], c[2]});
  if (!(largest > 0)) return Spectrum(1.0f);
  return {static_cast<float>(c[0] / largest), static_cast<float>(c[1] / largest),
          static_cast<float>(c[2] / largest)};
}

Channels stretch_transmittance(const scene::Medium& medium, double length) {
  const Spectrum sigma = medium.sigma_t({});
  const Channels s{static_cast<double>(sigma.r), static_cast<double>(sigma.g), static_cast<double>(sigma.b)};
  Channels t{};
  for (std::size_t i = 0; i < 3; ++i) t[i] = s[i] > 0 ? math::exp(-s[i] * length) : 1;
  return t;
}

}  // namespace

Channels Evaluation::transmittance(const Edge& edge) const {
  Channels t{1, 1, 1};
  for (std::size_t j = 0; j < edge.stretches.size(); ++j) {
    const Stretch& stretch = edge.stretches[j];
    if (stretch.medium == scene::kNone || !scene_.medium(stretch.medium).homogeneous()) continue;
    const Channels passed = stretch_transmittance(scene_.medium(stretch.medium), stretch.length);
    for (std::size_t c = 0; c < 3; ++c) t[c] *= passed[c];
  }
  for (const Pass& pass : edge.passes)
    for (std::size_t c = 0; c < 3; ++c) t[c] *= pass.fraction[c];
  return t;
}

// The cosine at the edge's end towards the eye is the bsdf's, or the lens'.
Channels Evaluation::passed_along(std::size_t i) const {
  const double leaving = numbers_.in_medium[i] ? 1 : numbers_.factor_to_eye[i];
  Channels passed{1, 1, 1};
  if (!edges_[i].is_plain()) passed = transmittance(edges_[i]);
  for (double& one : passed) one *= leaving / numbers_.distance_squared[i];
  return passed;
}

std::array<Scaled, 3> Evaluation::contribution() const {
  std::array<Scaled, 3> f;
  for (std::size_t c = 0; c < 3; ++c) f[c] = Scaled(emitted_[c]) * importance_;
  for (std::size_t i = 0; i < numbers_.edges; ++i) {
    const Channels passed = passed_along(i);
    for (std::size_t c = 0; c < 3; ++c) f[c] *= i > 0 ? passed[c] * inner_[i - 1].value[c] : passed[c];
  }
  return f;
}

std::array<double, 3> Evaluation::contribution_values() const {
  constexpr double kLeast = 0x1p-900, kMost = 0x1p900;  // no digit is lost between them
  Channels f{};
  bool holds = true;
  const auto multiply = [&](std::size_t c, double factor) {
    const double product = f[c] * factor;
    holds = holds && ((product > kLeast && product < kMost) || (product == 0 && (f[c] == 0 || factor == 0)));
    f[c] = product;
  };
  for (std::size_t c = 0; c < 3; ++c) {
    f[c] = emitted_[c];
    multiply(c, importance_);
  }
  for (std::size_t i = 0; i < numbers_.edges; ++i) {
    const Channels passed = passed_along(i);
    for (std::size_t c = 0; c < 3; ++c) multiply(c, i > 0 ? passed[c] * inner_[i - 1].value[c] : passed[c]);
  }
  if (holds) return f;
  const std::array<Scaled, 3> scaled = contribution();
  return {scaled[0].value(), scaled[1].value(), scaled[2].value()};
}

// The density of the flight along an edge, and of passing its surfaces straight. color: of what the walk
// carries, which chooses the channel of a flight; on return that behind the edge. No flight is longer than
// `longest`.
Scaled Evaluation::fly(bool from_light, std::size_t i, Arrival arrival, bool expects_passes, Channels& color,
                       double longest) const {
  const Edge& edge = edges_[i];
  const std::size_t count = edge.stretches.size();
  Scaled density = 1;
  for (std::size_t j = 0; j < count; ++j) {
    const bool last = j + 1 == count;
    const Stretch& stretch = edge.stretches[from_light ? j : count - 1 - j];
    if (stretch.medium != scene::kNone && scene_.medium(stretch.medium).homogeneous()) {
      const scene::Medium& medium = scene_.medium(stretch.medium);
      const auto length = static_cast<float>(std::min(stretch.length, longest));
      const Channels passed = stretch_transmittance(medium, stretch.length);
      double p = 1;
      if (!last || arrival == Arrival::surface)
        p = static_cast<double>(medium.prob_pass(length, spectrum(color)));
      else if (arrival == Arrival::medium)
        p = static_cast<double>(medium.pdf_distance(length, spectrum(color)));
      density *= p;
      for (std::size_t c = 0; c < 3; ++c) color[c] *= passed[c] / p;
    }
    if (last) break;
    const Pass& pass = edge.passes[from_light ? j : count - 2 - j];
    if (!expects_passes) density *= from_light ? pass.prob_from_light : pass.prob_from_eye;
    for (std::size_t c = 0; c < 3; ++c) color[c] *= pass.fraction[c];
  }
  return density;
}

double Evaluation::leaving_density(bool from_light, std::size_t v) const {
  const PathNumbers& n = numbers_;
  const std::size_t before = from_light ? v - 1 : v + 1;
  if (before == (from_light ? 0 : n.edges)) return from_light ? n.pdf_to_eye[0] : n.pdf_to_light[n.edges];
  return from_light ? inner_[before - 1].prob_to_eye : inner_[before - 1].prob_to_light;
}

double Evaluation::plain_step_density(bool from_light, std::size_t v) const {
  const PathNumbers& n = numbers_;
  return leaving_density(from_light, v) * (from_light ? n.factor_to_light[v] : n.factor_to_eye[v]) /
         n.distance_squared[from_light ? v - 1 : v];
}

Scaled Evaluation::step_density(bool from_light, std::size_t v) const {
  if (steps_plainly(from_light, v)) return plain_step_density(from_light, v);
  const PathNumbers& n = numbers_;
  const std::size_t edge = from_light ? v - 1 : v;
  Scaled density = leaving_density(from_light, v);
  const Arrival arrival = n.in_medium[v] ? Arrival::medium : v == n.edges ? Arrival::lens : Arrival::surface;
  Channels white{1, 1, 1};
  // A mutation's walk flies through all of a medium without an end.
  density *= fly(from_light, edge, arrival, false, white, static_cast<double>(Ray().t_max));
  if (!n.in_medium[v]) density *= from_light ? n.factor_to_light[v] : n.factor_to_eye[v];
  return density / n.distance_squared[edge];
}

double Evaluation::held_step_density(bool from_light, std::size_t v) const {
  if (steps_plainly(from_light, v)) return held(plain_step_density(from_light, v));
  const Scaled density = step_density(from_light, v);
  return density.holds() ? density.value() : 0;
}

double Evaluation::prob_stay(bool from_light, std::size_t v) const {
  if (!scene_.features().any_passthrough || numbers_.in_medium[v]) return 1;
  const scene::SurfaceHit& hit = v == 0 ? path_.light : path_.inner[v - 1].hit;
  const Vec3 wo = hit.shading.to_local(from_light ? -path_.along[v - 1] : path_.along[v]);
  scene::ClosureArena arena;
  const scene::Closure closure = scene_.closure(hit, wo, arena);
  double stays = 1;
  for (const scene::DeltaLobe& lobe :
       scene::delta_lobes(closure, wo, from_light ? TransportMode::importance : TransportMode::radiance))
    if (lobe.passthrough) stays -= static_cast<double>(lobe.prob);
  return std::max(stays, 0.0);
}

Scaled Evaluation::walk_density(bool from_light, std::size_t count) const {
  const PathNumbers& n = numbers_;
  const std::size_t k = n.edges;
  if (count == 0) return 1;
  Scaled density = from_light ? n.light_prob : n.lens_prob;
  Channels color = from_light ? emitted_ : Channels{1, 1, 1};
  for (std::size_t step = 1; step < count; ++step) {
    const std::size_t v = from_light ? step : k - step;  // arrived at
    const std::size_t before = from_light ? v - 1 : v + 1, edge = from_light ? v - 1 : v;
    if (step == 1) {
      density *= from_light ? n.pdf_to_eye[0] : n.pdf_to_light[k];
    } else {
      const Inner& x = inner_[before - 1];
      density *= from_light ? x.prob_to_eye : x.prob_to_light;
      const Spectrum scattered = spectrum(x.value);
      color[0] *= static_cast<double>(scattered.r);
      color[1] *= static_cast<double>(scattered.g);
      color[2] *= static_cast<double>(scattered.b);
    }
    const Arrival arrival = n.in_medium[v] ? Arrival::medium : v == k ? Arrival::lens : Arrival::surface;
    density *= fly(from_light, edge, arrival,
                   step >= (from_light ? rules_.max_light_edges : rules_.max_edges), color);
    // A flight's density has the hazard in it.
    if (!n.in_medium[v]) density *= from_light ? n.factor_to_light[v] : n.factor_to_eye[v];
    density /= n.distance_squared[edge];
    const Spectrum whole = spectrum(color);
    color = {static_cast<double>(whole.r), static_cast<double>(whole.g), static_cast<double>(whole.b)};
  }
  return density;
}

Channels Evaluation::estimator_value(const Technique& technique) const {
  const std::size_t k = numbers_.edges, s = technique.light_vertices;
  Scaled density;
  switch (technique.kind) {
    case Technique::Kind::hit_light:
      density = walk_density(false, k + 1);
      break;
    case Technique::Kind::next_event:
      density = walk_density(false, k) * numbers_.light_direct;
      break;
    case Technique::Kind::connect:
      density = walk_density(true, s) * walk_density(false, k + 1 - s);
      break;
    case Technique::Kind::light_image:
      density = walk_density(true, k) * numbers_.lens_connect;
      break;
    case Technique::Kind::hit_lens:
      density = walk_density(true, k + 1);
      break;
    case Technique::Kind::merge:  // of two vertices at one place
    case Technique::Kind::merge_point_beam:
    case Technique::Kind::merge_beam_point:
    case Technique::Kind::merge_beam_beam:
      density = walk_density(true, s + 1) * walk_density(false, k + 1 - s);
      break;
  }
  if (density.is_zero()) return {};
  const std::array<Scaled, 3> f = contribution();
  return {(f[0] / density).value(), (f[1] / density).value(), (f[2] / density).value()};
}

}  // namespace candela::transport::path
