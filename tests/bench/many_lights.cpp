// Direct light from many small lamps: the light tree against a choice of lamps by power alone, in turn (A B A
// B), as relMSE times CPU seconds against a long run of the tree.
//
//   bench_many_lights LAMPS [--size PIXELS] [--samples N] [--reference N] [--rounds K]
//
// The scene is generated: a ground of 100 m by 100 m, lamps of 5 cm to 20 cm above it, in clusters, most of
// them shining down, with powers over three orders of magnitude; a third are points. Loading is reported, not
// counted.
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "common/rng/stream.h"
#include "tests/bench/count_argument.h"
#include "tests/unit/scene_fixture.h"
#include "worker/scene/emitters/lights.h"

namespace {

using namespace candela;

double cpu_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec) + 1e-6 * static_cast<double>(usage.ru_utime.tv_usec);
}

long peak_kib() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss;
}

std::string lamps(int count) {
  rng::Stream stream(rng::key(1, 0x6c616d7073ULL));
  const auto uniform = [&] { return stream.next_double(); };
  std::string text =
      "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"50\"/></transform></shape>\n";
  double cx = 0, cy = 0;
  for (int i = 0; i < count; ++i) {
    if (i % 16 == 0) {  // the next cluster
      cx = 96 * uniform() - 48;
      cy = 96 * uniform() - 48;
    }
    const double x = cx + 2 * uniform() - 1, y = cy + 2 * uniform() - 1, z = 0.5 + 3 * uniform();
    const double level = std::pow(10.0, 3 * uniform() - 1), size = 0.025 + 0.075 * uniform();
    if (i % 3 == 0) {
      text += fmt::format(
          "<emitter type=\"point\"><point name=\"position\" x=\"{}\" y=\"{}\" z=\"{}\"/><rgb "
          "name=\"intensity\" "
          "value=\"{}\"/></emitter>\n",
          x, y, z, level * 0.01);
    } else {
      text += fmt::format(
          "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"{}\"/><rotate x=\"1\" "
          "y=\"{}\" "
          "angle=\"{}\"/><translate x=\"{}\" y=\"{}\" z=\"{}\"/></transform><emitter type=\"area\"><rgb "
          "name=\"radiance\" value=\"{}\"/></emitter></shape>\n",
          size, 2 * uniform() - 1, 180 + 80 * (uniform() - 0.5), x, y, z, level);
    }
  }
  return text;
}

struct Film {
  int size;
  std::vector<double> sums;
  double samples = 0;
};

// Adds `samples` to each pixel: one eye ray, one lamp each.
void render(const scene::Scene& scene, scene::LightTechnique technique, int samples, std::uint64_t seed,
            Film& film) {
  rng::Stream stream(rng::key(2, seed));
  for (int y = 0; y < film.size; ++y) {
    for (int x = 0; x < film.size; ++x) {
      double sum = 0;
      for (int i = 0; i < samples; ++i) {
        float weight = 0;
        const float fx = static_cast<float>(x) + stream.next_float();
        const Ray ray = scene.camera_ray(fx, static_cast<float>(y) + stream.next_float(), {}, weight);
        const float choice = stream.next_float(), u = stream.next_float(), v = stream.next_float();
        scene::SurfaceHit hit;
        if (!scene.intersect(ray, hit)) continue;
        const Vec3 front = dot(hit.ng, ray.direction) > 0 ? -hit.ng : hit.ng;
        scene::DirectSample light;
        if (scene.lights().sample(hit, front, choice, {u, v}, light, technique) !=
                scene::DirectOutcome::sampled ||
            scene.occluded(light.shadow_ray))
          continue;
        sum += static_cast<double>(light.radiance.g * dot(front, light.wi) / light.pdf_solid_angle);
      }
      film.sums[static_cast<std::size_t>(y) * static_cast<std::size_t>(film.size) +
                static_cast<std::size_t>(x)] += sum;
    }
  }
  film.samples += samples;
}

// Mean of (a - r)^2 / (r^2 + e^2), e a hundredth of the mean.
double relmse(const Film& a, const Film& reference) {
  double mean = 0, sum = 0;
  for (const double r : reference.sums)
    mean += r / reference.samples / static_cast<double>(reference.sums.size());
  for (std::size_t i = 0; i < a.sums.size(); ++i) {
    const double r = reference.sums[i] / reference.samples, d = a.sums[i] / a.samples - r;
    sum += d * d / (r * r + 1e-4 * mean * mean);
  }
  return sum / static_cast<double>(a.sums.size());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: LAMPS [--size PIXELS] [--samples N] [--reference N] [--rounds K]\n");
    return 2;
  }
  const auto count = static_cast<int>(bench::count_argument("LAMPS", argv[1], 1, 1e7));
  int size = 64, samples = 32, reference_samples = 1024, rounds = 3;
  for (int i = 2; i + 1 < argc; i += 2) {
    const std::string option = argv[i];
    int* target = option == "--size"        ? &size
                  : option == "--samples"   ? &samples
                  : option == "--reference" ? &reference_samples
                  : option == "--rounds"    ? &rounds
                                            : nullptr;
    if (target == nullptr) {
      std::fprintf(stderr, "unknown option %s\n", option.c_str());
      return 2;
    }
    *target = static_cast<int>(bench::count_argument(option, argv[i + 1], 1, 1e6));
  }
  const std::string sensor =
      "<sensor type=\"perspective\"><transform name=\"to_world\"><lookat origin=\"0,-70,30\" "
      "target=\"0,0,0\" up=\"0,0,1\"/></transform><float name=\"fov\" value=\"50\"/></sensor>";
  const std::string body = lamps(count);
  scene::Scene::Options options;
  options.film_width = options.film_height = static_cast<std::uint32_t>(size);
  const double loading = cpu_seconds();
  const auto built = test::build_scene(body, {}, sensor, options);
  if (!built.ok()) {
    std::fprintf(stderr, "%s\n", built.error().to_string().c_str());
    return 2;
  }
  const scene::Scene& scene = **built;
  std::printf("%d lamps loaded in %.2f CPU s, peak memory so far %ld MiB\n", count, cpu_seconds() - loading,
              peak_kib() / 1024);
  const std::size_t pixels = static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
  if (reference_samples == 0) return 0;  // loading alone
  Film reference{size, std::vector<double>(pixels), 0};
  render(scene, scene::LightTechnique::adapted, reference_samples, 1000, reference);
  std::vector<double> efficiencies[2];
  for (int round = 0; round < rounds; ++round) {
    for (const int which : {0, 1}) {
      Film film{size, std::vector<double>(pixels), 0};
      const double begin = cpu_seconds();
      render(scene, which == 0 ? scene::LightTechnique::adapted : scene::LightTechnique::power, samples,
             static_cast<std::uint64_t>(round + 1), film);
      const double seconds = cpu_seconds() - begin, error = relmse(film, reference);
      efficiencies[which].push_back(error * seconds);
      std::printf("%-5s %.2f CPU s, %.3f M samples/s, relMSE %.4e, relMSE x CPU s %.4e\n",
                  which == 0 ? "tree" : "power", seconds,
                  static_cast<double>(pixels) * samples / seconds * 1e-6, error, error * seconds);
    }
  }
  for (auto& e : efficiencies) std::sort(e.begin(), e.end());
  std::printf("median relMSE x CPU s: tree %.4e, power %.4e, ratio %.2f\n",
              efficiencies[0][efficiencies[0].size() / 2], efficiencies[1][efficiencies[1].size() / 2],
              efficiencies[1][efficiencies[1].size() / 2] / efficiencies[0][efficiencies[0].size() / 2]);
  return 0;
}
