// `path` rays per second, shading and sampling included, against bare Embree for exactly the same rays: those
// that the path tracer traces for a stretch of pixels, recorded once and replayed through rtcIntersect1 and
// rtcOccluded1 on the same Embree scene. Also Scene::intersect and Scene::occluded on them: what recomputing
// hits costs. CPU time of one thread, five rounds in turn, medians.
//
//   bench_rays SCENE.xml [SAMPLES [MAX_DEPTH]]        default 200000 samples, depth 8
#include <embree3/rtcore.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <vector>

#include "common/bundle/gather.h"
#include "tests/bench/count_argument.h"
#include "worker/estimators/path.h"
#include "worker/samplers/sampler.h"
#include "worker/scene/scene.h"

namespace {

using namespace candela;

constexpr std::uint32_t kExtent = 256;  // pixels a side

struct Recorded {
  Ray ray;
  bool shadow;
};

// A scene that writes down the rays it is asked for. The rest is the scene's own.
class Recorder {
 public:
  Recorder(const scene::Scene& scene, std::vector<Recorded>& rays) : scene_(scene), rays_(rays) {}
  bool intersect(const Ray& ray, scene::SurfaceHit& hit) const {
    rays_.push_back({ray, false});
    return scene_.intersect(ray, hit);
  }
  bool occluded(const Ray& ray) const {
    rays_.push_back({ray, true});
    return scene_.occluded(ray);
  }
  scene::Closure closure(const scene::SurfaceHit& hit, Vec3 wo, scene::ClosureArena& arena) const {
    return scene_.closure(hit, wo, arena);
  }
  const scene::SceneFeatures& features() const { return scene_.features(); }
  Spectrum emitted(const scene::SurfaceHit& hit, Vec3 wo) const { return scene_.emitted(hit, wo); }
  Spectrum environment(Vec3 d) const { return scene_.environment(d); }
  scene::DirectOutcome sample_direct(const scene::SurfaceHit& reference, Vec3 front, float u_select, Vec2 u,
                                     scene::DirectSample& out) const {
    return scene_.sample_direct(reference, front, u_select, u, out);
  }
  float pdf_direct_solid_angle(const scene::SurfaceHit& reference, Vec3 front, Vec3 d,
                               const scene::SurfaceHit& hit) const {
    return scene_.pdf_direct_solid_angle(reference, front, d, hit);
  }
  float pdf_direct_environment_solid_angle(const scene::SurfaceHit& reference, Vec3 front, Vec3 d) const {
    return scene_.pdf_direct_environment_solid_angle(reference, front, d);
  }

 private:
  const scene::Scene& scene_;
  std::vector<Recorded>& rays_;
};

double cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

RTCRay embree_ray(const Ray& ray) {
  RTCRay out{};
  out.org_x = ray.origin.x;
  out.org_y = ray.origin.y;
  out.org_z = ray.origin.z;
  out.dir_x = ray.direction.x;
  out.dir_y = ray.direction.y;
  out.dir_z = ray.direction.z;
  out.tfar = ray.t_max;
  out.mask = 0xffffffffu;
  return out;
}

int fail(const std::string& message) {
  std::fprintf(stderr, "bench_rays: %s\n", message.c_str());
  return 2;
}

// The samples of the benchmark, in the order of a tile loop.
template <class SceneT>
double trace(const scene::Scene& scene, const SceneT& traced, std::uint64_t samples,
             std::uint32_t max_depth) {
  const estimators::PathOptions options{max_depth, 5, 1, transport::MisHeuristic::power};
  const estimators::Techniques techniques;
  samplers::Sampler sampler(samplers::SamplerKind::sobol, 1);
  film::SampleCounts sample_counts;
  double sum = 0;
  const std::uint64_t iterations = std::max<std::uint64_t>(1, samples / (kExtent * kExtent));
  std::uint64_t left = samples;
  for (std::uint32_t y = 0; y < kExtent && left > 0; ++y)
    for (std::uint32_t x = 0; x < kExtent && left > 0; ++x)
      for (std::uint64_t i = 0; i < iterations && left > 0; ++i, --left) {
        sampler.start(0, i, x, y);
        const Vec2 offset = sampler.next_2d();
        float weight = 0;
        const Ray ray = scene.camera_ray(static_cast<float>(x) + offset.x, static_cast<float>(y) + offset.y,
                                         {0.5f, 0.5f}, weight);
        using Tracer = estimators::PathTracer<transport::EdgeContent::nothing, SceneT, samplers::Sampler>;
        const Spectrum value = Tracer(traced, options, techniques, sampler, sample_counts).radiance(ray);
        sum += static_cast<double>(value.g);
      }
  return sum;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return fail("usage: SCENE.xml [SAMPLES [MAX_DEPTH]]");
  const std::filesystem::path path(argv[1]);
  const std::uint64_t samples = bench::count_argument("SAMPLES", argc, argv, 2, 200000, 1e9);
  const auto max_depth =
      static_cast<std::uint32_t>(bench::count_argument("MAX_DEPTH", argc, argv, 3, 8, 1e6));
  const bundle::DiskSource files(path.parent_path());
  const auto description = description::parse_scene(files, path.filename().string(), {});
  if (!description.ok()) return fail(description.error().to_string());
  scene::Scene::Options options;
  options.film_width = options.film_height = kExtent;
  const auto built = scene::Scene::build(*description, files, options);
  if (!built.ok()) return fail(built.error().to_string());
  const scene::Scene& scene = **built;

  std::vector<Recorded> rays;
  double checksum = trace(scene, Recorder(scene, rays), samples, max_depth);
  auto* embree = static_cast<RTCScene>(scene.embree_scene());
  if (embree == nullptr) return fail("Embree has no tree of so small a scene");
  std::vector<double> path_seconds, bare_seconds, scene_seconds;
  for (int round = 0; round < 5; ++round) {
    double begin = cpu_seconds();
    checksum -= trace(scene, scene, samples, max_depth);
    path_seconds.push_back(cpu_seconds() - begin);

    begin = cpu_seconds();
    for (const Recorded& r : rays) {
      RTCIntersectContext context;
      rtcInitIntersectContext(&context);
      if (r.shadow) {
        RTCRay query = embree_ray(r.ray);
        rtcOccluded1(embree, &context, &query);
        checksum += query.tfar < 0 ? 1 : 0;
      } else {
        RTCRayHit query{};
        query.ray = embree_ray(r.ray);
        query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
        rtcIntersect1(embree, &context, &query);
        checksum += static_cast<double>(query.hit.primID & 255u);
      }
    }
    bare_seconds.push_back(cpu_seconds() - begin);

    begin = cpu_seconds();
    for (const Recorded& r : rays) {
      if (r.shadow) {
        checksum += scene.occluded(r.ray) ? 1 : 0;
      } else {
        scene::SurfaceHit hit;
        if (scene.intersect(r.ray, hit)) checksum += static_cast<double>(hit.shading.s.x);
      }
    }
    scene_seconds.push_back(cpu_seconds() - begin);
  }
  const double millions = static_cast<double>(rays.size()) * 1e-6;
  const double p = median(path_seconds), b = median(bare_seconds), s = median(scene_seconds);
  std::printf("%s: %.1f M rays of %.2f M samples (checksum %.0f)\n", path.c_str(), millions,
              static_cast<double>(samples) * 1e-6, checksum);
  std::printf("bare Embree        %.2f M rays/s\n", millions / b);
  std::printf("Scene              %.2f M rays/s, %.0f %% of bare\n", millions / s, 100 * b / s);
  std::printf("path with shading  %.2f M rays/s, %.0f %% of bare\n", millions / p, 100 * b / p);
  return 0;
}
