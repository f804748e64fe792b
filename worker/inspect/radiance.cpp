#include "worker/inspect/radiance.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/film/counts.h"
#include "worker/estimators/path_dispatch.h"
#include "worker/inspect/parallel.h"
#include "worker/integrators/path/plan.h"
#include "worker/integrators/path/settings.h"
#include "worker/transport/letters/layer_sums.h"
#include "worker/transport/letters/path_letters.h"

namespace candela::inspect {
namespace {

using estimators::PathOptions;

bool is_finite(Spectrum s) {
  return std::isfinite(s.r) && std::isfinite(s.g) && std::isfinite(s.b);
}

Vec3d as_double(Spectrum s) {
  return {static_cast<double>(s.r), static_cast<double>(s.g), static_cast<double>(s.b)};
}

// The path tracer along any ray, of all light or of the selection. It is the form with letters for both: one
// form less to compile.
class Tracer {
 public:
  Tracer(const Session& session, const PathOptions& options, bool selects)
      : scene_(session.scene()),
        options_(options),
        selects_(selects),
        letters_(session.automaton(), session.request(), scene_, 1) {
    integrators::Planned planned = integrators::path::plan(options, scene_.features(), false);
    techniques_ = planned.techniques;
    radiance_ = estimators::path_radiance_in<samplers::Sampler>(scene_, planned.between, true);
  }

  Spectrum operator()(const Ray& ray, samplers::Sampler& sampler, film::SampleCounts& sample_counts) const {
    transport::EyeLetters letters(letters_);
    letters.begin(sampler.sample_key(), ray);
    const Spectrum all =
        radiance_(scene_, options_, techniques_, ray, sampler, sample_counts, nullptr, &letters);
    if (!selects_) return all;
    Spectrum before, chosen;
    for (const transport::LabelledSum& sum : letters.sums().sums()) {
      const Spectrum part = sum.sum - before;
      before = sum.sum;
      const auto matches = [&](std::size_t c) { return letters_.layer_bits(sum.labels[c]) != 0; };
      chosen += Spectrum(matches(0) ? part.r : 0, matches(1) ? part.g : 0, matches(2) ? part.b : 0);
    }
    return chosen;
  }

 private:
  const scene::Scene& scene_;
  const PathOptions options_;
  const bool selects_;
  estimators::Techniques techniques_;
  const transport::PathLetters letters_;
  estimators::RadianceFunction<samplers::Sampler> radiance_;
};

Error medium_error() {
  return usage_error("the probe is in another medium than the camera")
      .with_mend("move it, or look at the side of the camera: --disc");
}

Result<PathOptions> path_options(const Session& session) {
  CANDELA_ASSIGN(
      const integrators::PathSettings settings,
      integrators::parse_settings<integrators::PathSettings>(session.settings().integrator_settings));
  PathOptions options = settings.common.path_options();
  options.heuristic = integrators::heuristic_named(settings.heuristic.value);
  return options;
}

struct MapRow {
  std::vector<float> rgb;
  Vec3d fluence, irradiance;
  std::uint64_t not_finite = 0;
  bool other_medium = false;
};

class Mapper {
 public:
  Mapper(const Session& session, const MapRequest& request, const PathOptions& options)
      : session_(session), request_(request), trace_(session, options, session.selects()) {}

  MapRow row(std::uint32_t y) const {
    MapRow out;
    samplers::Sampler sampler(samplers::SamplerKind::independent, session_.settings().seed);
    film::SampleCounts sample_counts;
    for (std::uint32_t x = 0; x < request_.width; ++x) {
      Vec3d sum;
      for (std::uint64_t i = 0; i < request_.spp; ++i) add_sample(x, y, i, sampler, sample_counts, sum, out);
      const Vec3d mean = sum * (1 / static_cast<double>(request_.spp));
      for (const double v : {mean.x, mean.y, mean.z}) out.rgb.push_back(static_cast<float>(v));
    }
    return out;
  }

 private:
  void add_sample(std::uint32_t x, std::uint32_t y, std::uint64_t index, samplers::Sampler& sampler,
                  film::SampleCounts& sample_counts, Vec3d& sum, MapRow& out) const {
    sampler.start(0, index, x, y);
    sampler.set_dimension(0);
    const Vec2 at = sampler.next_2d(), on_disk = sampler.next_2d();
    const double v = (y + static_cast<double>(at.y)) / request_.height;
    const Vec3 d = map_direction((x + static_cast<double>(at.x)) / request_.width, v);
    const Probe& probe = request_.probe;
    const double cosine = probe.normal ? static_cast<double>(dot(d, *probe.normal)) : 0;
    if (probe.normal && !(cosine > 0)) return;
    const Ray ray = integrators::probe_ray(probe, d, on_disk);
    const scene::Scene& scene = session_.scene();
    if (scene.features().media > 0 && scene.medium_at(ray) != scene.camera_medium(ray)) {
      out.other_medium = true;
      return;
    }
    const Spectrum value = trace_(ray, sampler, sample_counts);
    if (!is_finite(value)) {
      ++out.not_finite;
      return;
    }
    sum += as_double(value);
    const double step = 2 * std::numbers::pi / request_.width * std::numbers::pi / request_.height *
                        std::sin(std::numbers::pi * v) / static_cast<double>(request_.spp);
    out.fluence += as_double(value) * step;
    out.irradiance += as_double(value) * (step * cosine);
  }

  const Session& session_;
  const MapRequest& request_;
  const Tracer trace_;
};

}  // namespace

Result<Probe> probe_of_pixel(const Session& session, std::uint32_t x, std::uint32_t y) {
  float response = 1;
  const Ray ray = session.scene().camera_ray(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f,
                                             {0.5f, 0.5f}, response);
  scene::SurfaceHit hit;
  if (!session.scene().intersect(ray, hit))
    return usage_error("the camera sees no surface there").with_mend("choose a pixel that shows a surface");
  const Vec3 normal = dot(hit.ng, ray.direction) > 0 ? -hit.ng : hit.ng;
  return Probe{hit.p, 0, normal, hit.error};
}

Result<RadianceMap> map_radiance(const Session& session, const MapRequest& request) {
  CANDELA_ASSIGN(PathOptions options, path_options(session));
  options.min_edges = 1;  // a probe sees the lamps
  const Mapper mapper(session, request, options);
  RadianceMap map;
  map.width = request.width;
  map.height = request.height;
  bool other_medium = false;
  for_each_in_order(
      request.height, request.threads,
      [&](std::uint64_t y) { return mapper.row(static_cast<std::uint32_t>(y)); },
      [&](std::uint64_t /*y*/, MapRow&& row) {
        map.rgb.insert(map.rgb.end(), row.rgb.begin(), row.rgb.end());
        map.fluence += row.fluence;
        map.irradiance += row.irradiance;
        map.not_finite += row.not_finite;
        other_medium |= row.other_medium;
      });
  if (other_medium) return medium_error();
  return map;
}

void integrate_map(const Probe& probe, RadianceMap& map) {
  map.fluence = map.irradiance = {};
  for (std::uint32_t y = 0; y < map.height; ++y) {
    const double v = (y + 0.5) / map.height;
    const double angle =
        2 * std::numbers::pi / map.width * std::numbers::pi / map.height * std::sin(std::numbers::pi * v);
    for (std::uint32_t x = 0; x < map.width; ++x) {
      const float* rgb = &map.rgb[3 * (std::size_t{y} * map.width + x)];
      const Vec3d light =
          Vec3d(static_cast<double>(rgb[0]), static_cast<double>(rgb[1]), static_cast<double>(rgb[2])) *
          angle;
      map.fluence += light;
      if (!probe.normal) continue;
      const Vec3 d = map_direction((x + 0.5) / map.width, v);
      map.irradiance += light * std::max(0.0, static_cast<double>(dot(d, *probe.normal)));
    }
  }
}

Result<void> check_medium(const Session& session, const Probe& probe) {
  const scene::Scene& scene = session.scene();
  if (scene.features().media == 0) return {};
  constexpr int kSide = 32;
  for (int i = 0; i < kSide * kSide; ++i) {
    const float u = (static_cast<float>(i % kSide) + 0.5f) / kSide,
                v = (static_cast<float>(i / kSide) + 0.5f) / kSide;
    const Vec3 d = map_direction(static_cast<double>(u), static_cast<double>(v));
    if (probe.normal && !(dot(d, *probe.normal) > 0)) continue;
    const Ray ray = integrators::probe_ray(probe, d, {v, u});
    if (scene.medium_at(ray) != scene.camera_medium(ray)) return medium_error();
  }
  return {};
}

std::vector<float> preview(const Session& session, std::uint32_t width, std::uint32_t height,
                           std::uint64_t spp, unsigned threads) {
  const PathOptions options;  // no limit of depth
  const Tracer trace(session, options, false);
  const JobSettings& job = session.settings();
  const float step_x = static_cast<float>(job.width) / static_cast<float>(width),
              step_y = static_cast<float>(job.height) / static_cast<float>(height);
  std::vector<float> rgb;
  const auto row = [&](std::uint64_t y) {
    std::vector<float> out;
    samplers::Sampler sampler(samplers::SamplerKind::sobol, job.seed);
    film::SampleCounts sample_counts;
    for (std::uint32_t x = 0; x < width; ++x) {
      Vec3d sum;
      for (std::uint64_t i = 0; i < spp; ++i) {
        sampler.start(0, i, x, static_cast<std::uint32_t>(y));
        sampler.set_dimension(0);
        const Vec2 u = sampler.next_2d();
        float response = 1;
        const Ray ray = session.scene().camera_ray(
            (static_cast<float>(x) + u.x) * step_x, (static_cast<float>(y) + u.y) * step_y,
            session.scene().reads_lens() ? sampler.next_2d() : Vec2{0.5f, 0.5f}, response);
        const Spectrum value = trace(ray, sampler, sample_counts) * response;
        if (is_finite(value)) sum += as_double(value);
      }
      for (const double v : {sum.x, sum.y, sum.z})
        out.push_back(static_cast<float>(v / static_cast<double>(spp)));
    }
    return out;
  };
  for_each_in_order(height, threads, row, [&](std::uint64_t /*y*/, std::vector<float>&& part) {
    rgb.insert(rgb.end(), part.begin(), part.end());
  });
  return rgb;
}

}  // namespace candela::inspect
