// The compiled scene's door.
#include "worker/scene/scene.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/base/log.h"
#include "common/base/work_monitor.h"
#include "common/description/color.h"
#include "worker/scene/points/surface_points.h"
#include "worker/scene/scene_builder.h"
#include "worker/scene/shapes/geometry_steps.h"

namespace candela::scene {

namespace {

class MetByRays final : public FirstSurface {
 public:
  explicit MetByRays(const Scene& scene) : scene_(scene) {}
  bool lies_in(const Cone& region, const Ray& ray, Vec3d offset) const override {
    SurfaceHit hit;
    return scene_.intersect(ray, hit) && encloses(region, Vec3d(hit.p) + offset);
  }

 private:
  const Scene& scene_;
};

}  // namespace

struct Scene::Impl : SceneData {
  std::optional<MetByRays> first_surface;
  std::uint32_t outer_medium = kNone;    // of the space around all surfaces
  bool camera_in_several_media = false;  // or it may be: each ray finds out
  Vec3d offset;
  std::optional<SurfacePoints> points;
};

namespace {
// True if the scene's integrator asks for it. Integrators that Candela lacks keep unchecked properties.
bool strict_normals(const description::Object& root) {
  const auto integrators = root.children_of("integrator");
  if (integrators.empty()) return false;
  const description::Property* property = integrators[0]->find("strict_normals");
  const bool* value = property == nullptr ? nullptr : std::get_if<bool>(&property->value);
  return value != nullptr && *value;
}

constexpr std::uint32_t kMaxProbes = 1u << 12;  // surfaces passed to learn what medium a place is in
}  // namespace

Scene::Scene() : impl_(std::make_unique<Impl>()) {}
Scene::~Scene() = default;

Result<std::unique_ptr<Scene>> Scene::build(const description::SceneDescription& description,
                                            const description::FileSource& files, const Options& options) {
  if (description.scene == nullptr) return internal_error("the scene description is empty");
  std::optional<Placement> far;
  std::optional<description::ReadingBudget> part(std::in_place,
                                                 description::ReadingBudget::PartOf{files.budget()});
  auto near = build_in_place(*description.scene, description::BudgetedFiles(files, *part), options,
                             options.in_place ? nullptr : &far);
  if (!far) {
    if (near.ok()) part->keep();
    return near;
  }
  if (near.ok()) near->reset();
  part.reset();
  const description::ObjectPtr root = moved(description.scene, *far);
  auto scene = build_in_place(*root, files, options, nullptr);
  // If the shapes could not be built in place, the middle was a guess, and so is this error.
  if (!scene.ok()) return near.ok() ? std::move(scene) : std::move(near);
  Impl& impl = *(*scene)->impl_;
  impl.offset = impl.edits.offset = far->middle;
  for (Bounds box = impl.geometry.bounds; const Vec3d p : {box.low + impl.offset, box.high + impl.offset})
    impl.features.largest_coordinate =
        std::max(impl.features.largest_coordinate,
                 static_cast<float>(std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)})));
  return scene;
}

Result<std::unique_ptr<Scene>> Scene::build_in_place(const description::Object& root,
                                                     const description::FileSource& files,
                                                     const Options& options, std::optional<Placement>* far) {
  const auto sensors = root.children_of("sensor");
  if (sensors.empty()) {
    return input_error("the scene has no sensor")
        .at(root.where.file, root.where.line)
        .with_mend("add <sensor type=\"perspective\">");
  }
  std::unique_ptr<Scene> scene(new Scene);
  Impl& impl = *scene->impl_;
  const auto metered = sensors[0]->children_of("shape");
  const bool is_meter = sensors[0]->plugin == "irradiancemeter" && metered.size() == 1;
  const bool is_distant = sensors[0]->plugin == "distant";
  if (!is_meter && !is_distant) {
    CANDELA_ASSIGN(impl.sensor,
                   Sensor::build(*sensors[0], options.film_width, options.film_height, options.crop));
  } else if (options.crop) {
    return input_error(fmt::format("the sensor '{}' has no crop of its image", sensors[0]->plugin))
        .at(sensors[0]->where.file, sensors[0]->where.line);
  }
  impl.features.any_color = description::has_color(root);
  impl.features.finite_lens = is_meter || impl.sensor.reads_lens();
  if (sensors.size() > 1) log::warn("the scene has several sensors; the first is used");

  impl.textures = std::make_unique<TextureStore>(files, options.textures, &impl.geometry);
  SceneBuilder builder(files, impl, options.parameterized);
  const bool edited = options.edits != nullptr && !options.edits->list.empty();
  if (options.named || edited) builder.name_objects(root);
  if (is_meter) builder.measure(*metered[0]);
  // Meshes are read by as many threads as the tree is built by.
  tbb::task_arena arena(static_cast<int>(std::max(1u, options.build_threads)));
  const Result<void> shaped = arena.execute([&, monitor = watched_work()] {
    const WatchedWork watch(monitor);  // TBB may choose another thread
    return builder.shapes(root);
  });
  if (far != nullptr) {
    const std::optional<Vec3d> camera = camera_place(*sensors[0]);
    if (shaped.ok()) {
      *far = builder.far_placement(camera);
    } else if (camera && !(*camera == Vec3d{})) {
      // Things too small for floats out there may be large enough near the origin.
      *far = placement_at(root, *camera);
    }
    if (*far && shaped.ok()) return scene;
  }
  CANDELA_TRY(shaped);
  if (strict_normals(root)) {
    for (Bsdf& bsdf : impl.bsdfs) {
      CANDELA_ASSIGN(bsdf, Bsdf::with_strict_normals(std::move(bsdf)));
    }
  }
  if (edited) CANDELA_TRY(builder.edit(*options.edits));
  const auto build_accel = [&]() -> Result<void> {
    Result<Accel> built = Accel::build(impl.geometry, options.isa, options.build_threads, files.budget());
    if (!built.ok() && built.error().kind == ErrorKind::input)
      return std::move(built).error().at(root.where.file, root.where.line);
    CANDELA_ASSIGN(Accel accel, std::move(built));
    impl.accel = std::make_unique<Accel>(std::move(accel));
    return {};
  };
  finish_vertices(impl.geometry);
  if (options.traced) CANDELA_TRY(build_accel());
  // A scene that is only described needs no triangles for rays, unless something of it looks at them.
  const bool asked_only = !options.traced && !edited && !is_meter && impl.media.size() == 0;
  CANDELA_TRY(builder.finish_geometry(!asked_only));
  if (is_distant) {
    CANDELA_ASSIGN(impl.sensor, Sensor::build_distant(*sensors[0], files, impl.geometry.bounds,
                                                      options.film_width, options.film_height));
  }
  if (is_meter) {
    if (builder.measured() == kNone) {
      return input_error("the shape of the irradiancemeter is inside a shapegroup")
          .at(sensors[0]->where.file, sensors[0]->where.line)
          .with_mend("take the shape out of its shapegroup");
    }
    impl.meter.emplace(impl.geometry, builder.measured(), builder.measured_rectangle(), options.film_width,
                       options.film_height);
  }
  for (const auto& emitter : root.children_of("emitter")) {
    work_step();
    CANDELA_TRY(builder.emitter(*emitter));
  }
  if (edited) CANDELA_TRY(builder.edit_lamps(*options.edits));
  impl.lights.finish();
  if (const auto media = sensors[0]->children_of("medium"); !media.empty()) {
    CANDELA_ASSIGN(impl.camera_medium, impl.media.add(media[0], files));
  }
  for (const Bsdf& bsdf : impl.bsdfs) impl.passthrough.push_back(bsdf.facts().passthrough);
  builder.finish_features();
  builder.finish_objects();
  if (edited) CANDELA_TRY(builder.finish_edits(*options.edits));
  if (!options.traced && impl.media.size() == 0) {
    CANDELA_TRY(check_isa(options.isa));
    return scene;
  }
  builder.make_triangles();  // for a medium of a lamp or of the camera
  if (!impl.accel) CANDELA_TRY(build_accel());
  impl.first_surface.emplace(*scene);
  impl.edits.first_surface = &*impl.first_surface;
  std::vector<bool> turned;
  for (const Bsdf& bsdf : impl.bsdfs) turned.push_back(bsdf.facts().perturbs);
  impl.points.emplace(impl.geometry, *impl.accel, std::move(turned));
  scene->find_media(static_cast<float>(options.film_width), static_cast<float>(options.film_height));
  return scene;
}

bool Scene::intersect(const Ray& ray, SurfaceHit& hit) const {
  Accel::Found found;
  if (!impl_->accel->intersect(ray, found)) return false;
  if (found.instance == kNone) [[likely]] {
    impl_->geometry.hit(ray, found.kind, found.primitive, hit);
  } else {
    impl_->geometry.instance_hit(ray, found.instance, found.kind, found.primitive, hit);
  }
  return true;
}

float Scene::clearance(Vec3 p, float limit) const {
  // The margin covers rounding: coordinates and distances are wrong by a few 2^-24 of the scene's size.
  const float size =
      impl_->features.largest_coordinate + std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)});
  return std::max(0.0f, impl_->accel->clearance(p, limit) - size * 0x1p-18f);
}

bool Scene::occluded(const Ray& ray) const {
  return impl_->accel->occluded(ray);
}

Closure Scene::closure(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena) const {
  Closure closure;
  impl_->bsdfs[hit.bsdf].prepare(hit, wo, arena, closure);
  return closure;
}

Spectrum Scene::passthrough(const SurfaceHit& hit, Vec3 wo_world) const {
  if (!impl_->passthrough[hit.bsdf]) return {};
  ClosureArena arena;
  const Vec3 wo = hit.shading.to_local(wo_world);
  return closure(hit, wo, arena).passthrough(wo);
}

const Medium& Scene::medium(std::uint32_t index) const {
  return impl_->media[index];
}

std::uint32_t Scene::camera_medium(const Ray& ray) const {
  return impl_->camera_in_several_media ? medium_at(ray) : impl_->camera_medium;
}

std::uint32_t Scene::emitter_medium(const EmissionSample& light) const {
  const std::uint32_t named = impl_->emitter_media[light.vertex.emitter];
  if (named != kNone || impl_->media.size() == 0) return named;
  return light.infinite ? impl_->outer_medium : medium_at(light.ray);
}

std::uint32_t Scene::medium_at(Ray ray) const {
  ray.t_max = Ray().t_max;  // a camera's far clip hides surfaces, not what it is in
  SurfaceHit hit;
  for (std::uint32_t passes = 0; passes < kMaxProbes && intersect(ray, hit); ++passes) {
    if (hit.medium_interface != kNone) return impl_->media.beyond(hit, -ray.direction, kNone);
    ray = spawn_ray(hit, ray.direction);
  }
  return impl_->outer_medium;
}

void Scene::find_media(float film_width, float film_height) {
  Impl& impl = *impl_;
  if (impl.media.size() == 0) return;
  float weight = 0;
  Ray ray = camera_ray(film_width / 2, film_height / 2, {0.5f, 0.5f}, weight);
  ray.t_max = Ray().t_max;
  // A named medium that is still around the ray when it leaves the scene fills the space outside.
  std::uint32_t medium = impl.camera_medium;
  SurfaceHit hit;
  Ray out = ray;
  for (std::uint32_t passes = 0; passes < kMaxProbes && intersect(out, hit); ++passes) {
    medium = impl.media.beyond(hit, out.direction, medium);
    out = spawn_ray(hit, out.direction);
  }
  impl.outer_medium = medium;
  if (medium != kNone && impl.media[medium].homogeneous()) {
    const Spectrum sigma_t = impl.media[medium].max_sigma_t();
    impl.features.endless_medium = std::min({sigma_t.r, sigma_t.g, sigma_t.b}) > 0;
  }
  if (impl.features.endless_medium &&
      (impl.features.any_environment || impl.features.emitter_kinds.contains("directional")))
    log::warn(
        "the medium around the scene has no end: light from outside (constant, envmap, directional) does "
        "not get in. Give the medium a boundary: a shape with a null bsdf that has it as its interior");
  if (impl.camera_medium != kNone) return;
  impl.camera_medium = medium_at(ray);
  impl.camera_in_several_media = impl.meter || media_meet_at_camera(film_width, film_height);
}

bool Scene::media_meet_at_camera(float film_width, float film_height) const {
  // Camera rays start here: from corners of the film and of the square of lens samples, and somewhat more,
  // as a lens bulges beyond the chords of its rim.
  Bounds box;
  float weight = 0;
  for (unsigned corner = 0; corner < 4; ++corner)
    for (unsigned lens = 0; lens < 64; ++lens) {
      const Vec2 u_lens{static_cast<float>(lens % 8) / 7, static_cast<float>(lens / 8) / 7};
      const Ray ray = camera_ray((corner & 1) != 0 ? film_width : 0.0f,
                                 (corner & 2) != 0 ? film_height : 0.0f, u_lens, weight);
      box.add(Vec3d(ray.origin));
    }
  const double more = 0.1 * box.radius();
  box.low = box.low - Vec3d{more, more, more};
  box.high = box.high + Vec3d{more, more, more};
  const Geometry& geometry = impl_->geometry;
  bool any = false;
  for (std::uint32_t shape = 0; shape < geometry.shapes.size(); ++shape) {
    if (geometry.shapes[shape].medium_interface == kNone) continue;
    if (geometry.may_cross(shape, box)) return true;
    any = true;
  }
  return any && std::any_of(geometry.instances.begin(), geometry.instances.end(),
                            [&](const Instance& instance) { return overlap(instance.bounds, box); });
}

std::uint32_t Scene::medium_beyond(const SurfaceHit& hit, Vec3 d, std::uint32_t current) const {
  return impl_->media.beyond(hit, d, current);
}

Spectrum Scene::emitted(const SurfaceHit& hit, Vec3 wo_world) const {
  return hit.emitter == kNone ? Spectrum() : impl_->lights.emitted(hit, wo_world);
}

Spectrum Scene::environment(Vec3 d) const {
  return impl_->lights.environment(d);
}

DirectOutcome Scene::sample_direct(const SurfaceHit& reference, Vec3 front, float u_select, Vec2 u,
                                   DirectSample& out) const {
  return impl_->lights.sample(reference, front, u_select, u, out);
}

float Scene::pdf_direct_solid_angle(const SurfaceHit& reference, Vec3 front, Vec3 d,
                                    const SurfaceHit& hit) const {
  return hit.emitter == kNone ? 0.0f : impl_->lights.pdf_solid_angle(reference, front, d, hit);
}

float Scene::prob_direct(const SurfaceHit& reference, Vec3 front, std::uint32_t emitter) const {
  return impl_->lights.prob(reference.p, front, emitter);
}

float Scene::pdf_direct_environment_solid_angle(const SurfaceHit& reference, Vec3 front, Vec3 d) const {
  return impl_->lights.pdf_environment_solid_angle(reference, front, d);
}

const Lights& Scene::lights() const {
  return impl_->lights;
}

bool Scene::sample_emission(float u_select, Vec2 u_position, Vec2 u_direction, EmissionSample& out) const {
  return impl_->lights.sample_emission(u_select, u_position, u_direction, out);
}

bool Scene::pdf_emission(const SurfaceHit& hit, Vec3 d, EmissionDensity& out) const {
  return impl_->lights.pdf_emission(hit, d, out);
}

bool Scene::pdf_emission(const DirectSample& light, EmissionDensity& out) const {
  return impl_->lights.pdf_emission(light, out);
}

bool Scene::pdf_emission_environment(Vec3 d, EmissionDensity& out) const {
  return impl_->lights.pdf_emission_environment(d, out);
}

float Scene::prob_emission(std::uint32_t i) const {
  return impl_->lights.prob_emission(i);
}

bool Scene::reads_lens() const {
  return impl_->features.finite_lens;
}

Ray Scene::camera_ray(float film_x, float film_y, Vec2 u_lens, float& weight) const {
  if (impl_->meter) [[unlikely]] {
    weight = IrradianceMeter::kResponse;
    return impl_->meter->ray(film_x, film_y, u_lens);
  }
  weight = 1;
  return impl_->sensor.ray(film_x, film_y, u_lens);
}

double Scene::near_distance(const Ray& camera_ray) const {
  return impl_->meter ? 0.0 : impl_->sensor.near_distance(camera_ray.direction);
}

std::uint32_t Scene::primitive_in_shape(const SurfaceHit& hit) const {
  const ShapeRecord& shape = impl_->geometry.shapes[hit.shape];
  return shape.triangle_count > 0 ? hit.primitive - shape.first_triangle : 0;
}

double Scene::boundary_test(const SurfaceHit& hit, Vec3 d) const {
  const Geometry& geometry = impl_->geometry;
  const ShapeRecord& shape = geometry.shapes[hit.shape];
  const double cosine = std::abs(static_cast<double>(dot(hit.shading.n, d)));
  if (shape.disk != kNone) return std::abs(1 - static_cast<double>(hit.uv.x));
  if (shape.triangle_count == 0) return cosine;
  const Triangle& triangle = geometry.triangles[hit.primitive];
  if (triangle.smooth) return cosine * cosine;
  const auto b1 = static_cast<double>(hit.barycentric.x), b2 = static_cast<double>(hit.barycentric.y);
  return 3 * std::clamp(std::min({b1, b2, 1 - b1 - b2}), 0.0, 1.0 / 3);
}

bool Scene::sample_camera(const SurfaceHit& reference, Vec2 u_lens, CameraSample& out,
                          float film_border) const {
  if (impl_->meter) [[unlikely]]
    return impl_->meter->sample(reference, u_lens, out);
  return impl_->sensor.sample(reference, u_lens, film_border, out);
}

bool Scene::pdf_camera(Vec3 point, Vec3 direction, CameraDensity& out, float film_border) const {
  if (impl_->meter) [[unlikely]] {
    const Ray ray{point, direction};
    SurfaceHit behind;
    const bool found = impl_->meter->is_mesh() && intersect({point, -direction}, behind);
    return impl_->meter->density(impl_->meter->start_of(ray, found ? &behind : nullptr), direction, out);
  }
  return impl_->sensor.density(point, direction, film_border, out);
}

bool Scene::pdf_camera(const CameraSample& sampled, Vec3 seen_from, CameraDensity& out,
                       float film_border) const {
  if (impl_->meter) [[unlikely]] {
    impl_->meter->density(sampled, out);
    return true;
  }
  return impl_->sensor.density(seen_from, -sampled.wi, film_border, out);
}

bool Scene::meets_camera(const Ray& ray, const SurfaceHit* next, float& distance, CameraDensity& out,
                         float film_border) const {
  if (impl_->meter) [[unlikely]] {
    if (next == nullptr || !impl_->meter->is_on(*next)) return false;
    distance = next->distance;
    return impl_->meter->density(*next, -ray.direction, out);
  }
  return impl_->sensor.intersect(ray, film_border, distance, out) &&
         (next == nullptr || distance < next->distance);
}

Vec3d Scene::offset() const {
  return impl_->offset;
}

const SceneObjects& Scene::objects() const {
  return impl_->objects;
}

const SceneFeatures& Scene::features() const {
  return impl_->features;
}

const SurfacePoints& Scene::points() const {
  return *impl_->points;
}

void* Scene::embree_scene() const {
  return impl_->accel->embree_scene();
}

}  // namespace candela::scene
