// Rays per second of Scene::intersect against bare rtcIntersect1 for the same rays: what recomputing the hit
// and making a frame cost. usage: bench_rays SCENE.xml [RAYS]
//
// Rays: the camera's, and four cosine-distributed bounces after each. Both sides trace the identical list, in
// turn, five times over; the best of each counts. CPU time of this thread.
#include <embree3/rtcore.h>

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <vector>

#include "common/bundle/bundle.h"
#include "common/rng/stream.h"
#include "worker/core/warp.h"
#include "worker/scene/scene.h"

namespace {

using namespace candela;

double cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: bench_rays SCENE.xml [RAYS]\n");
    return 2;
  }
  const std::filesystem::path path(argv[1]);
  const std::size_t ray_count = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1000000;
  const bundle::DiskSource files(path.parent_path());
  const auto description = description::parse_scene(files, path.filename().string(), {});
  if (!description.ok()) {
    std::fprintf(stderr, "%s\n", description.error().to_string().c_str());
    return 2;
  }
  scene::Scene::Options options;
  options.film_width = options.film_height = 256;
  const auto built = scene::Scene::build(*description, files, options);
  if (!built.ok()) {
    std::fprintf(stderr, "%s\n", built.error().to_string().c_str());
    return 2;
  }
  const scene::Scene& scene = **built;

  rng::Stream stream(rng::key(1, 2));
  std::vector<Ray> rays;
  rays.reserve(ray_count);
  while (rays.size() < ray_count) {
    float weight = 0;
    const float x = 256 * stream.next_float();
    Ray ray = scene.camera_ray(x, 256 * stream.next_float(), {0.5f, 0.5f}, weight);
    for (int depth = 0; depth < 5 && rays.size() < ray_count; ++depth) {
      rays.push_back(ray);
      scene::SurfaceHit hit;
      if (!scene.intersect(ray, hit)) break;
      const float u = stream.next_float();
      Vec3 d = hit.shading.to_world(warp::cosine_hemisphere({u, stream.next_float()}));
      if (dot(hit.shading.n, ray.direction) > 0) d = -d;
      ray = spawn_ray(hit, d);
    }
  }

  double scene_seconds = 1e9, occluded_seconds = 1e9, bare_seconds = 1e9, checksum = 0;
  auto* embree = static_cast<RTCScene>(scene.embree_scene());
  for (int round = 0; round < 5; ++round) {
    double begin = cpu_seconds();
    for (const Ray& ray : rays) {
      RTCIntersectContext context;
      rtcInitIntersectContext(&context);
      RTCRayHit query{};
      query.ray = {ray.origin.x,
                   ray.origin.y,
                   ray.origin.z,
                   0,
                   ray.direction.x,
                   ray.direction.y,
                   ray.direction.z,
                   0,
                   ray.t_max,
                   0xffffffffu,
                   0,
                   0};
      query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
      rtcIntersect1(embree, &context, &query);
      checksum += static_cast<double>(query.hit.primID & 255u);
    }
    bare_seconds = std::min(bare_seconds, cpu_seconds() - begin);
    begin = cpu_seconds();
    for (const Ray& ray : rays) {
      scene::SurfaceHit hit;
      if (scene.intersect(ray, hit)) checksum += static_cast<double>(hit.shading.s.x);
    }
    scene_seconds = std::min(scene_seconds, cpu_seconds() - begin);
    begin = cpu_seconds();
    for (const Ray& ray : rays) checksum += scene.occluded(ray) ? 1 : 0;
    occluded_seconds = std::min(occluded_seconds, cpu_seconds() - begin);
  }
  const double millions = static_cast<double>(rays.size()) * 1e-6;
  std::printf("triangles %llu spheres %u rays %.1f M (checksum %.0f)\n",
              static_cast<unsigned long long>(scene.features().triangles), scene.features().spheres, millions,
              checksum);
  std::printf("rtcIntersect1      %.2f Mrays/s\n", millions / bare_seconds);
  std::printf("Scene::intersect   %.2f Mrays/s (%.0f %%)\n", millions / scene_seconds,
              100 * bare_seconds / scene_seconds);
  std::printf("Scene::occluded    %.2f Mrays/s\n", millions / occluded_seconds);
  return 0;
}
