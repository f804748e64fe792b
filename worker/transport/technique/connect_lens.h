// t = 1: a light vertex connected to the lens, a splat.
#pragma once

#include "worker/core/measure.h"
#include "worker/transport/technique/contribution.h"

namespace candela::transport {

// The light's vertex z connected to a point on the lens. The value is for a film of splats filtered by
// PixelFilter::eval, one light path in the iteration: to be divided by their number.
template <EdgeContent kEdgeContent, class Mis, class SamplerT, EtaField Eta>
bool connect_lens(const ConnectContext& c, const VertexDraws<SamplerT>& draws,
                  const Vertex<typename Mis::Block>& z, const Eta& eta_field, FilmPosition& film,
                  Contribution& out, WeightTerms* terms = nullptr, Towards* towards = nullptr) {
  scene::CameraSample camera;
  const Vec2 u_lens = c.scene.reads_lens() ? draws.draw_2d(kLens) : Vec2{0.5f, 0.5f};
  if (!c.scene.sample_camera(z.hit, u_lens, camera, c.rules.film_border)) return false;
  float pdf = 0;
  const Spectrum value = scatter_value(c.scene, z, z.wo, camera.wi, TransportMode::importance, pdf);
  if (value.is_black()) return false;
  double survival = 1;
  const Spectrum passed =
      visibility<kEdgeContent>(c, z, camera.shadow_ray, passage_key<kEdgeContent>(c, draws), survival);
  if (passed.is_black()) return false;
  film = {camera.film_x, camera.film_y};
  out.value = z.throughput * value * passed * (camera.importance / camera.pdf_solid_angle);
  out.weight = 1;
  if (towards != nullptr) *towards = {camera.wi};
  if constexpr (Mis::kWeighs) {
    const MergeFactors eta = eta_field.at(film);
    scene::CameraDensity density;
    double traced = 0, reverse = 0;
    if (c.scene.pdf_camera(camera, z.hit.p, density, c.rules.film_border)) {
      // The eye's walk's density of z: of one ray through every pixel.
      const double place = camera.delta_direction ? static_cast<double>(density.pdf_area)
                                                  : solid_angle_to_perpendicular(
                                                        static_cast<double>(density.pdf_solid_angle),
                                                        length_squared(Vec3d(z.hit.p) - Vec3d(camera.p)));
      traced = c.rules.eye_paths * place * survival * static_cast<double>(z.density_factor(camera.wi));
      reverse =
          static_cast<double>(pdf_scatter_solid_angle(c.scene, z, camera.wi, z.wo, TransportMode::radiance));
    }
    double met = 0;
    if (c.rules.meets_lens && !camera.delta_position && !camera.delta_direction)
      met = static_cast<double>(pdf) / static_cast<double>(camera.pdf_solid_angle);
    const double merged = merges_at<Mis>(c, SubpathOf::light, z, camera.wi, survival, eta);
    // Both divided by the number of samples this technique takes.
    const double rest =
        Mis::raise(traced) * (merged + Mis::sum(z.mis, reverse, eta)) + c.factors.hit_lens * Mis::raise(met);
    out.weight = 1 / (1 + rest / c.factors.light_image);
    if (terms != nullptr)
      *terms = {.next = c.factors.hit_lens * met / c.factors.light_image,
                .light_step = traced / c.factors.light_image,
                .light_reverse = reverse};
  }
  return true;
}

}  // namespace candela::transport
