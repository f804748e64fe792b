// Paths of walks from the eye in a room of glass, rough metal, plastic and matt walls under lamps of all
// kinds, and what they bring by next event estimation: by code of its own.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tests/unit/scene_fixture.h"
#include "worker/transport/film_position.h"
#include "worker/transport/path/full_path.h"

namespace candela::transport::path {

using scene::Scene;
using test::build_scene;

inline constexpr std::uint32_t kFilm = 16;
inline constexpr double kPixels = kFilm * kFilm;

struct WalkedPath {
  FullPath path;
  Vec2 u_lens;
  FilmPosition film;
  std::array<double, 3> value{};
};

struct Step {
  InnerVertex vertex;
  Vec3 to_eye;  // world
};

inline std::optional<WalkedPath> light_directly(const Scene& scene, const std::vector<Step>& steps,
                                                const scene::Closure& closure, Spectrum throughput,
                                                rng::Stream& stream) {
  const Step& last = steps.back();
  const scene::SurfaceHit& hit = last.vertex.hit;
  scene::DirectSample light;
  const float u_select = stream.next_float(), u = stream.next_float();
  Vec3 front;
  if (!closure.scatters_through())
    front = dot(last.to_eye, hit.shading.n) < 0 ? -hit.shading.n : hit.shading.n;
  if (scene.sample_direct(hit, front, u_select, {u, stream.next_float()}, light) !=
      scene::DirectOutcome::sampled)
    return std::nullopt;
  if (scene.occluded(light.shadow_ray)) return std::nullopt;
  const Spectrum f = closure.eval(hit.shading.to_local(last.to_eye), hit.shading.to_local(light.wi),
                                  TransportMode::radiance);
  const Spectrum value = throughput * f * light.radiance * (1 / light.pdf_solid_angle);
  if (value.is_black()) return std::nullopt;
  WalkedPath out;
  out.value = {static_cast<double>(value.r), static_cast<double>(value.g), static_cast<double>(value.b)};
  FullPath& path = out.path;
  path.light.emitter = light.emitter;
  path.light_infinite = light.infinite;
  path.light_delta_position = light.delta && !light.infinite;
  path.light_delta_direction = light.delta && light.infinite;
  if (!light.delta && !light.infinite) {
    const float back = 1e-3f * length(light.p - hit.p);
    if (!scene.intersect({light.p - light.wi * back, light.wi}, path.light)) return std::nullopt;
  }
  path.along.push_back(-light.wi);
  for (std::size_t i = steps.size(); i-- > 0;) {
    path.inner.push_back(steps[i].vertex);
    path.along.push_back(steps[i].to_eye);
  }
  return out;
}

// All paths of one walk of up to four vertices.
template <class Visit>
void walk(const Scene& scene, rng::Stream& stream, const Visit& visit) {
  const FilmPosition film{stream.next_float() * kFilm, stream.next_float() * kFilm};
  const Vec2 u_lens{stream.next_float(), stream.next_float()};
  float weight = 1;
  Ray ray = scene.camera_ray(film.x, film.y, u_lens, weight);
  Spectrum throughput(weight);
  std::vector<Step> steps;
  for (int depth = 0; depth < 4; ++depth) {
    Step step;
    if (!scene.intersect(ray, step.vertex.hit)) return;
    const scene::SurfaceHit& hit = step.vertex.hit;
    step.to_eye = -ray.direction;
    steps.push_back(step);
    scene::ClosureArena arena;
    const Vec3 wo = hit.shading.to_local(step.to_eye);
    const scene::Closure closure = scene.closure(hit, wo, arena);
    if (auto found = light_directly(scene, steps, closure, throughput, stream)) {
      found->u_lens = u_lens;
      found->film = film;
      visit(*found);
    }
    scene::BsdfSample sample;
    const float u_lobe = stream.next_float(), u = stream.next_float();
    if (!closure.sample(wo, u_lobe, {u, stream.next_float()}, TransportMode::radiance, sample)) return;
    steps.back().vertex.delta = sample.delta;
    throughput = throughput * sample.weight;
    ray = spawn_ray(hit, hit.shading.to_world(sample.wi));
  }
}

inline const std::string kRoom =
    "<shape type='rectangle'><transform name='to_world'><scale value='4'/><translate z='5'/><rotate x='1' "
    "angle='0'/></transform><bsdf type='twosided'><bsdf type='diffuse'/></bsdf></shape>"
    "<shape type='sphere'><point name='center' x='-1' y='0.3' z='3.5'/><float name='radius' value='0.7'/>"
    "<bsdf type='dielectric'/></shape>"
    "<shape type='shapegroup' id='g'><shape type='sphere'><bsdf type='roughconductor'><float name='alpha' "
    "value='0.2'/></bsdf></shape></shape>"
    "<shape type='instance'><ref id='g'/><transform name='to_world'><scale x='0.5' y='0.8' z='0.6'/>"
    "<translate x='1' y='-0.2' z='3.4'/></transform></shape>"
    "<shape type='rectangle'><transform name='to_world'><rotate x='1' angle='-90'/><scale value='4'/>"
    "<translate y='-1.4' z='3'/></transform><bsdf type='twosided'><bsdf type='plastic'/></bsdf></shape>";
inline const std::string kThinLens =
    "<sensor type='thinlens'><float name='fov' value='60'/><float name='aperture_radius' value='0.1'/>"
    "<float name='focus_distance' value='3'/></sensor>";
inline const std::string kOrthographic =
    "<sensor type='orthographic'><transform name='to_world'><scale value='2'/></transform></sensor>";

struct Case {
  std::string name, lamp, sensor;
};
inline std::vector<Case> cases() {
  const std::string area =
      "<shape type='rectangle'><transform name='to_world'><scale value='0.5'/><rotate x='1' angle='90'/>"
      "<translate y='1.8' z='3'/></transform><emitter type='area'><rgb name='radiance' value='3, 2, "
      "1'/></emitter></shape>";
  return {
      {"area", area, ""},
      {"area, thin lens", area, kThinLens},
      {"area, orthographic", area, kOrthographic},
      {"round area",
       "<shape type='sphere'><point name='center' x='0' y='2' z='2'/><float name='radius' value='0.3'/>"
       "<emitter type='area'><rgb name='radiance' value='5, 4, 3'/></emitter></shape>",
       kThinLens},
      {"point", "<emitter type='point'><point name='position' x='0.3' y='1.5' z='2'/></emitter>", ""},
      {"spot",
       "<emitter type='spot'><transform name='to_world'><lookat origin='0, 2, 1' target='0, 0, 4' up='0, "
       "1, 0.1'/></transform><float name='cutoff_angle' value='50'/></emitter>",
       kThinLens},
      {"directional", "<emitter type='directional'><vector name='direction' x='0.3' y='-1' z='1'/></emitter>",
       ""},
      {"environment", "<emitter type='constant'><rgb name='radiance' value='1, 2, 3'/></emitter>", ""},
      {"two lamps", area + "<emitter type='point'><point name='position' x='0.3' y='1.5' z='2'/></emitter>",
       kOrthographic}};
}

inline std::unique_ptr<Scene> scene_of(const Case& c) {
  Scene::Options options;
  options.film_width = options.film_height = kFilm;
  auto scene = build_scene(kRoom + c.lamp, {}, c.sensor, options);
  EXPECT_TRUE(scene.ok()) << c.name << ": " << scene.error().to_string();
  return std::move(scene).value();
}

}  // namespace candela::transport::path
