// A compiled scene: immutable, shared by all threads. Embree is hidden behind it.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "common/base/result.h"
#include "common/description/object.h"
#include "common/job/job.h"
#include "worker/core/vec.h"
#include "worker/scene/bsdf.h"
#include "worker/scene/camera.h"
#include "worker/scene/emitters/emitter.h"
#include "worker/scene/features.h"
#include "worker/scene/hit.h"
#include "worker/scene/media/medium.h"
#include "worker/scene/textures/scratch.h"

namespace candela::scene {

class Lights;
class SurfacePoints;
struct Placement;
struct SceneObjects;
struct EditRequest;

class Scene {
 public:
  struct Options {
    std::string isa = "avx2";  // the ISA Embree may use
    unsigned build_threads = 1;
    std::uint32_t film_width = 1, film_height = 1;  // for the sensor's aspect
    std::optional<Crop> crop = {};                  // of a larger image; nothing: all of it
    TextureLimits textures;
    // All hits have uv, dp_du and dp_dv, not those alone whose bsdfs read them. Tangent frames follow dp_du
    // then, so that samples of bsdfs differ.
    bool parameterized = false;
    bool named = false;                  // objects() is filled
    const EditRequest* edits = nullptr;  // null: none; objects() is filled if there are any
    // False: no tree is built where the scene has no media, and rays meet nothing: for its features alone.
    bool traced = true;
    bool in_place = false;  // for measurements: a scene far from the origin stays there (placement.h)
  };
  static Result<std::unique_ptr<Scene>> build(const description::SceneDescription& description,
                                              const description::FileSource& files, const Options& options);
  ~Scene();

  // The nearest surface; false: the ray leaves the scene.
  bool intersect(const Ray& ray, SurfaceHit& hit) const;
  bool occluded(const Ray& ray) const;
  // A lower bound, at most `limit`, of the distance from p to the nearest surface. No ray of a length below
  // it meets anything. Precondition: p is finite.
  float clearance(Vec3 p, float limit) const;

  // The bsdf at a hit, textures looked up, for a walk that arrived against `wo` (in the shading frame,
  // towards where it came from). Parts of composite bsdfs are in the arena, which the caller clears between
  // hits.
  Closure closure(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena) const;

  // The fraction of light along -wo (unit, world) that passes the surface straight on: what
  // Closure::passthrough says, and quickly nothing where the surface lets nothing pass so.
  Spectrum passthrough(const SurfaceHit& hit, Vec3 wo_world) const;

  // Media by index. A walk carries the index of the medium it is in, kNone outside of all: it starts in
  // camera_medium() or emitter_medium(), and goes on from a surface in medium_beyond(hit, direction, the
  // medium it came through). Where the scene does not name the camera's or an emitter's medium it is the one
  // that fills the place (medium_at), so that walks of both directions see the same scene.
  const Medium& medium(std::uint32_t index) const;
  // Medium at the start of a ray of camera_ray().
  std::uint32_t camera_medium(const Ray& ray) const;
  std::uint32_t emitter_medium(const EmissionSample& light) const;
  // The medium at a ray's origin, told by the first surface along it where media meet.
  std::uint32_t medium_at(Ray ray) const;
  std::uint32_t medium_beyond(const SurfaceHit& hit, Vec3 d, std::uint32_t current) const;

  // Radiance the surface at `hit` emits towards wo (unit, world); black where it is no emitter or wo is
  // behind it.
  Spectrum emitted(const SurfaceHit& hit, Vec3 wo_world) const;
  // Radiance from outside the scene (all environments together) arriving along -d, i.e. seen looking along d.
  Spectrum environment(Vec3 d) const;

  // Next event estimation. `front`: the shading normal turned to the side that scatters (the viewer's);
  // emitters wholly behind it may be left out. Zero where light from both sides counts (transmission, media).
  // u_select and u are from the vertex's block; u_select is not read where there is one emitter and it is no
  // mesh. Light is to be had only where the outcome is `sampled`.
  DirectOutcome sample_direct(const SurfaceHit& reference, Vec3 front, float u_select, Vec2 u,
                              DirectSample& out) const;
  // The density with which sample_direct would have chosen the direction d to the emitting surface `hit`.
  float pdf_direct_solid_angle(const SurfaceHit& reference, Vec3 front, Vec3 d, const SurfaceHit& hit) const;
  // The discrete probability with which it would have chosen this emitter: all there is to say of one that is
  // met by no ray (point, spot, directional).
  float prob_direct(const SurfaceHit& reference, Vec3 front, std::uint32_t emitter) const;
  // As pdf_direct_solid_angle, for a direction that leaves the scene.
  float pdf_direct_environment_solid_angle(const SurfaceHit& reference, Vec3 front, Vec3 d) const;
  // The emitters and all techniques of direct light, beside the one above (emitters/lights.h).
  const Lights& lights() const;

  // Light paths: an emitter chosen by power, a place on it and a direction; see EmissionSample for densities
  // and measures. u_select and u_position are read together. False: no light by this choice.
  bool sample_emission(float u_select, Vec2 u_position, Vec2 u_direction, EmissionSample& out) const;
  // The densities with which sample_emission would have chosen light leaving the emitting surface `hit` along
  // d (unit); that which sample_direct found (traveling along -light.wi); or that from outside the scene
  // seen looking along d. False: it never does.
  bool pdf_emission(const SurfaceHit& hit, Vec3 d, EmissionDensity& out) const;
  bool pdf_emission(const DirectSample& light, EmissionDensity& out) const;
  bool pdf_emission_environment(Vec3 d, EmissionDensity& out) const;
  // The discrete probability with which sample_emission chooses emitter i in [0, features().emitters).
  float prob_emission(std::uint32_t i) const;

  // A ray through film position (x, y) in pixels, (0, 0) the top left corner, between the clip planes.
  // u_lens: where on a finite lens; not read unless reads_lens(), a fact of the scene.
  // weight: the sensor's response (1, as Mitsuba means it; pi of an irradiance meter).
  bool reads_lens() const;
  Ray camera_ray(float film_x, float film_y, Vec2 u_lens, float& weight) const;
  // From the pinhole, or the point on the lens, to where such a ray begins: along its unit direction to the
  // near plane. 0 for an orthographic camera, whose rays begin there.
  double near_distance(const Ray& camera_ray) const;

  // The number of a hit's primitive within its shape: of a triangle in its mesh; 0 of other shapes.
  std::uint32_t primitive_in_shape(const SurfaceHit& hit) const;
  // Mitsuba 3's test for boundaries: 0 where the surface ends or turns away from `d` (unit, towards the
  // surface), and up to 1 elsewhere. Of flat triangles the least barycentric coordinate times 3, of smooth
  // ones the squared cosine, of spheres and cylinders the cosine, of disks the distance from the rim.
  // Precondition: the scene is parameterized.
  double boundary_test(const SurfaceHit& hit, Vec3 d) const;

  // For paths from the light: see camera.h for measures and normalization. Film positions up to film_border
  // pixels outside the film count as on it, since a reconstruction filter reaches beyond it.
  // A lens point seen from the reference; false: no camera ray comes there.
  bool sample_camera(const SurfaceHit& reference, Vec2 u_lens, CameraSample& out,
                     float film_border = 0) const;
  // The densities with which camera_ray chooses the ray through `point` (any point on it) along `direction`
  // (unit, away from the camera); false: it cannot. If the sensor is an irradiance meter, `point` is where
  // camera_ray begins.
  bool pdf_camera(Vec3 point, Vec3 direction, CameraDensity& out, float film_border = 0) const;
  // The same of the ray from where sample_camera() put it to the point that it was seen from.
  bool pdf_camera(const CameraSample& sampled, Vec3 seen_from, CameraDensity& out,
                  float film_border = 0) const;
  // A ray of light that meets a finite lens by itself before the surface that it meets next, if any:
  // `distance` to the near plane. An irradiance meter is met at that surface.
  bool meets_camera(const Ray& ray, const SurfaceHit* next, float& distance, CameraDensity& out,
                    float film_border = 0) const;

  const SceneFeatures& features() const;
  // Empty unless the options ask for it.
  const SceneObjects& objects() const;
  // A point of this scene and this vector make the point in the coordinates of the scene's file: a scene far
  // from the origin is moved to its own middle.
  Vec3d offset() const;

  // Points of its surfaces in double, with derivatives (points/surface_points.h).
  const SurfacePoints& points() const;

  // Embree's own scene (an RTCScene), for measurements beside it.
  void* embree_scene() const;

 private:
  Scene();
  // Stops and fills `far` if that is given and the scene has to be moved; the result is then of no use.
  static Result<std::unique_ptr<Scene>> build_in_place(const description::Object& root,
                                                       const description::FileSource& files,
                                                       const Options& options, std::optional<Placement>* far);
  // Media of the space outside and of the camera, where they are not named.
  void find_media(float film_width, float film_height);
  // True if places that camera rays start at may be in several media.
  bool media_meet_at_camera(float film_width, float film_height) const;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace candela::scene
