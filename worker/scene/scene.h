// A compiled scene: immutable, shared by all threads. Embree is hidden behind it.
#pragma once

#include <memory>
#include <string>

#include "common/base/result.h"
#include "common/description/object.h"
#include "common/film/film.h"
#include "worker/core/vec.h"
#include "worker/scene/bsdf.h"
#include "worker/scene/emitter.h"
#include "worker/scene/features.h"
#include "worker/scene/hit.h"

namespace candela::scene {

class Scene {
 public:
  struct Options {
    std::string isa = "avx2";  // the ISA Embree may use
    unsigned build_threads = 1;
    std::uint32_t film_width = 1, film_height = 1;  // for the sensor's aspect
  };
  static Result<std::unique_ptr<Scene>> build(const description::SceneDescription& description,
                                              const description::FileSource& files, const Options& options);
  ~Scene();

  // The nearest surface; false: the ray leaves the scene.
  bool intersect(const Ray& ray, SurfaceHit& hit) const;
  bool occluded(const Ray& ray) const;

  // The bsdf at a hit, textures looked up, for a walk that arrived against `wo` (world, towards where it came
  // from).
  Closure closure(const SurfaceHit& hit, Vec3 wo_world) const;

  // Radiance the surface at `hit` emits towards wo (unit, world); black where it is no emitter or wo is
  // behind it.
  Spectrum emitted(const SurfaceHit& hit, Vec3 wo_world) const;
  // Radiance from outside the scene (all environments together) arriving along -d, i.e. seen looking along d.
  Spectrum environment(Vec3 d) const;

  // Next event estimation. `front`: the shading normal turned to the side that scatters (the viewer's);
  // emitters wholly behind it may be left out. Zero where light from both sides counts (transmission, media).
  // u_select and u are from the vertex's block; u_select is not read where there is one emitter and it is no
  // mesh. False: no emitter can light this point by this choice.
  bool sample_direct(const SurfaceHit& reference, Vec3 front, float u_select, Vec2 u,
                     DirectSample& out) const;
  // The density with which sample_direct would have chosen the direction d to the emitting surface `hit`.
  float pdf_direct_solid_angle(const SurfaceHit& reference, Vec3 front, Vec3 d, const SurfaceHit& hit) const;
  // The same for a direction that leaves the scene.
  float pdf_direct_environment_solid_angle(const SurfaceHit& reference, Vec3 front, Vec3 d) const;

  // A ray through film position (x, y) in pixels, (0, 0) the top left corner; u_lens for finite lenses.
  // weight: the sensor's response (1 for a pinhole as Mitsuba means it).
  // Lenses are still to come: no sensor reads u_lens yet.
  static constexpr bool reads_lens() { return false; }
  Ray camera_ray(float film_x, float film_y, Vec2 u_lens, float& weight) const;

  const SceneFeatures& features() const;

  // Embree's own scene (an RTCScene), for measurements beside it.
  void* embree_scene() const;

 private:
  Scene();
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace candela::scene
