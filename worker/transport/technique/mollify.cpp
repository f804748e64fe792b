#include "worker/transport/technique/mollify.h"

#include <cmath>

#include "worker/transport/scattering.h"

namespace candela::transport {
namespace {

// The form for all scenes: these connections are few.
constexpr EdgeContent kEdgeContent = EdgeContent::media;

}  // namespace

scene::TurningLobes lobes_at(const ScatterPoint& v, float u_lobe, Vec2 u, TransportMode mode) {
  return SurfaceScattering(v.hit, v.closure, v.wo).delta_lobes(u_lobe, u, mode);
}

Spectrum lobes_towards(const scene::TurningLobes& lobes, Vec3 ng, Vec3d to, const Mollifier& mollifier) {
  Spectrum sum;
  const double side = dot(to, Vec3d(ng));
  for (const scene::TurningLobe& lobe : lobes) {
    const bool same_side = static_cast<double>(dot(lobe.wi, ng)) * side > 0;
    if (same_side && mollifier.inside(Vec3d(lobe.wi), to)) sum += lobe.attenuation;
  }
  return sum;
}

double far_length(const scene::Scene& scene) {
  return 2 * static_cast<double>(scene.features().radius);
}

bool mollified_connect(const ConnectContext& c, const MollifiedEnd& light, const MollifiedEnd& eye,
                       std::uint64_t stream_key, const Mollifier& mollifier, Contribution& out) {
  const ScatterPoint &z = light.v, &y = eye.v;
  const Vec3d between = Vec3d(z.hit.p) - Vec3d(y.hit.p);
  const double distance_squared = length_squared(between);
  if (!(distance_squared > 0)) return false;
  const Vec3 to_light = Vec3(between / std::sqrt(distance_squared));
  // The cone is the rarest of all that has to fit.
  Spectrum delta = eye.lobes != nullptr ? lobes_towards(*eye.lobes, y.hit.ng, between, mollifier)
                                        : lobes_towards(*light.lobes, z.hit.ng, -between, mollifier);
  if (delta.is_black() || !may_meet<kEdgeContent>(c, y, z, to_light)) return false;
  float pdf = 0;
  delta *= eye.lobes != nullptr ? scatter_value(c.scene, z, z.wo, -to_light, TransportMode::importance, pdf)
                                : scatter_value(c.scene, y, y.wo, to_light, TransportMode::radiance, pdf);
  if (delta.is_black()) return false;
  const Ray ray = spawn_shadow_ray(y.hit, z.hit.p, z.on_surface() ? z.hit.ng : Vec3{}, z.hit.error);
  double survival = 1;
  const Spectrum passed = visibility<kEdgeContent>(c, y, ray, stream_key, survival);
  if (passed.is_black()) return false;
  out.value = y.throughput * delta * passed * z.throughput *
              static_cast<float>(mollifier.value_over_length_squared(distance_squared));
  out.weight = 1;
  return true;
}

Spectrum light_in_lobes(const scene::Scene& scene, const SurfaceHit& v, const scene::TurningLobes& lobes,
                        const scene::DirectSample& light, const Mollifier& mollifier, double& length) {
  const Vec3d to = light.infinite ? Vec3d(light.wi) * far_length(scene) : Vec3d(light.p) - Vec3d(v.p);
  const double distance_squared = length_squared(to);
  // Exact: lengths of edges to both ends compare as equal.
  length = light.infinite ? far_length(scene) : std::sqrt(distance_squared);
  const Spectrum attenuation = lobes_towards(lobes, v.ng, to, mollifier);
  // The light's value has the division by its squared distance.
  return attenuation * light.radiance *
         static_cast<float>(mollifier.value(distance_squared) / static_cast<double>(light.pdf_solid_angle));
}

bool mollified_light(const ConnectContext& c, const ScatterPoint& v, const scene::TurningLobes& lobes,
                     const scene::DirectSample& light, std::uint64_t stream_key, const Mollifier& mollifier,
                     Contribution& out, double& length) {
  const Spectrum value = light_in_lobes(c.scene, v.hit, lobes, light, mollifier, length);
  if (value.is_black()) return false;
  double survival = 1;
  const Spectrum passed = visibility<kEdgeContent>(c, v, light.shadow_ray, stream_key, survival);
  if (passed.is_black()) return false;
  out.value = v.throughput * value * passed;
  out.weight = 1;
  return true;
}

bool mollified_lens(const ConnectContext& c, const ScatterPoint& z, const scene::TurningLobes& lobes,
                    std::uint64_t stream_key, const Mollifier& mollifier, FilmPosition& film,
                    Contribution& out, double& length) {
  scene::CameraSample camera;
  if (!c.scene.sample_camera(z.hit, {0.5f, 0.5f}, camera, c.rules.film_border)) return false;
  const Vec3d to =
      camera.delta_direction ? Vec3d(camera.wi) * far_length(c.scene) : Vec3d(camera.p) - Vec3d(z.hit.p);
  const double distance_squared = length_squared(to);
  length = camera.delta_direction ? far_length(c.scene) : std::sqrt(distance_squared);
  const Spectrum attenuation = lobes_towards(lobes, z.hit.ng, to, mollifier);
  if (attenuation.is_black()) return false;
  double survival = 1;
  const Spectrum passed = visibility<kEdgeContent>(c, z, camera.shadow_ray, stream_key, survival);
  if (passed.is_black()) return false;
  film = {camera.film_x, camera.film_y};
  out.value = z.throughput * attenuation * passed *
              static_cast<float>(mollifier.value(distance_squared) *
                                 static_cast<double>(camera.importance / camera.pdf_solid_angle));
  out.weight = 1;
  return true;
}

}  // namespace candela::transport
