// t = 0: a light path meets a lens of finite size, a splat.
#pragma once

#include <algorithm>
#include <limits>

#include "worker/core/measure.h"
#include "worker/transport/technique/contribution.h"

namespace candela::transport {

// A light walk met the lens. terms: light_step is that of the vertex it came from, whose pdf_reverse
// is known. To be divided by the number of light paths.
template <class WalkT, EtaField Eta>
Contribution hit_lens(const ConnectContext& c, const WalkT& walk, const Eta& eta_field, FilmPosition& film,
                      WeightTerms* terms = nullptr) {
  using Mis = typename WalkT::Mis;
  const auto& met = walk.lens();
  Contribution out;
  film = {met.camera.film_x, met.camera.film_y};
  out.value = met.throughput * met.camera.importance;
  out.weight = 1;
  if (met.edges < 2) return {};  // light seen directly is the eye's walk's alone
  if constexpr (Mis::kWeighs) {
    const typename Mis::Departure& d = walk.departure();
    const auto cosine = static_cast<double>(met.camera.cosine);
    const double distance_squared = std::max(length_squared(Vec3d(met.camera.p) - Vec3d(walk.from())),
                                             std::numeric_limits<double>::min());
    // Density of the lens' point as the light walk finds it, without survival: see Walk::look_for_lens.
    const double found = solid_angle_to_area(d.pdf, cosine, distance_squared);
    const auto lens_area_pdf = static_cast<double>(met.camera.pdf_area);
    double rest = 0;
    if (d.connects > 0) rest = c.factors.light_image * Mis::raise(lens_area_pdf / found);
    // The eye's walk takes the same edge the other way, with survival.
    const double traced = lens_area_pdf * c.rules.eye_paths *
                          static_cast<double>(met.camera.pdf_solid_angle) * met.survival * d.leave / cosine;
    if (terms != nullptr)  // from the walk's last vertex on, where it left
      *terms = {.next = rest / c.factors.hit_lens, .light_step = traced / c.factors.hit_lens};
    rest += Mis::raise(traced) * Mis::sum_departure(d, eta_field.at(film), met.survival);
    out.weight = 1 / (1 + rest / c.factors.hit_lens);
  }
  return out;
}

}  // namespace candela::transport
