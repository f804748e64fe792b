// The integrator of the jobs of `candela inspect sphere`: a path tracer whose film is a map of the directions
// around a place (probe.h).
#include <cmath>

#include "worker/estimators/path_dispatch.h"
#include "worker/integrators/eye_samples.h"
#include "worker/integrators/makers.h"
#include "worker/integrators/path/plan.h"
#include "worker/integrators/sphere/probe.h"
#include "worker/integrators/sphere/settings.h"

namespace candela::integrators {
namespace {

class SphereIntegrator final : public Integrator {
 public:
  SphereIntegrator(const SphereSettings& settings, const estimators::PathOptions& options, Planned planned,
                   bool letters)
      : settings_(settings), options_(options), planned_(std::move(planned)), letters_(letters) {}

  Result<Decision> decide(const UnitContext& /*context*/, const RunContext& /*run*/) const override {
    return Decision{{}, planned_.plan};
  }

  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& /*input*/,
                   UnitOutput& output, const RunContext& run_context) const override {
    film::UnitFilm& film = *output.film;
    const Samples samples(*this, context, letters_);
    return for_each_tile(
        context.width, context.height, film, run_context,
        [&](std::uint32_t x0, std::uint32_t y0, std::uint32_t x1, std::uint32_t y1,
            film::SampleCounts& sample_counts) {
          samplers::Sampler sampler(context.sampler, context.seed);
          std::optional<transport::EyeLetters> letters;
          if (context.letters != nullptr) letters.emplace(*context.letters);
          for (std::uint32_t y = y0; y < y1; ++y)
            for (std::uint32_t x = x0; x < x1; ++x) {
              for (std::uint64_t index = unit.begin; index < unit.end; ++index) {
                if (run_context.stopped()) return;
                sampler.start(unit.half, index, x, y);
                const std::uint64_t key = sampler.sample_key();
                Spectrum value =
                    samples.radiance(x, y, sampler, sample_counts, letters ? &*letters : nullptr);
                if (run_context.fault != nullptr) run_context.fault(key, &value.r);
                const bool kept = film.add(0, x, y, {value.r, value.g, value.b}, key, sample_counts);
                if (letters && kept) letters->sums().gather(film, 1, key);
              }
              if (letters) letters->sums().write_gathered(film, x, y);
              sample_counts.eye_samples += unit.end - unit.begin;
            }
        });
  }

  std::vector<float> pilot_luminances(const UnitContext& context, std::uint32_t count) const override {
    const Samples samples(*this, context, false);
    std::vector<float> luminances;
    film::SampleCounts sample_counts;
    samplers::Sampler sampler(samplers::SamplerKind::independent,
                              rng::key(context.seed, 0x70696c6f74ULL));  // "pilot"
    for (std::uint32_t i = 0; i < count; ++i) {
      work_step();
      rng::Stream place(rng::key(context.seed, 0x706c616365ULL, i));  // "place"
      const auto x = static_cast<std::uint32_t>(place.next_double() * context.width);
      const auto y = static_cast<std::uint32_t>(place.next_double() * context.height);
      sampler.start(0, i, x, y);
      const float value = luminance(samples.radiance(x, y, sampler, sample_counts, nullptr));
      if (std::isfinite(value)) luminances.push_back(std::fabs(value));
    }
    return luminances;
  }

 private:
  // The samples of one scene.
  class Samples {
   public:
    Samples(const SphereIntegrator& sphere, const UnitContext& context, bool letters)
        : sphere_(sphere),
          context_(context),
          radiance_(estimators::path_radiance_in<samplers::Sampler>(context.scene, sphere.planned_.between,
                                                                    letters)) {
      const SphereSettings& s = sphere.settings_;
      probe_.center = Vec3(Vec3d(s.x, s.y, s.z) - context.scene.offset());
      probe_.radius = s.radius;
      probe_.error = static_cast<float>(s.error);
      const Vec3 normal(Vec3d(s.normal_x, s.normal_y, s.normal_z));
      if (length_squared(normal) > 0) probe_.normal = normal;
    }

    // The radiance of a sample of the map's pixel; black on the far side of a disk. letters: null where
    // nobody asks.
    Spectrum radiance(std::uint32_t x, std::uint32_t y, samplers::Sampler& sampler,
                      film::SampleCounts& sample_counts, transport::EyeLetters* letters) const {
      sampler.set_dimension(0);
      const Vec2 at = sampler.next_2d(), on_disk = sampler.next_2d();
      const Vec3 d = map_direction((x + static_cast<double>(at.x)) / context_.width,
                                   (y + static_cast<double>(at.y)) / context_.height);
      const Ray ray = probe_ray(probe_, d, on_disk);
      if (letters != nullptr) letters->begin(sampler.sample_key(), ray);
      if (probe_.normal && !(dot(d, *probe_.normal) > 0)) return {};
      return radiance_(context_.scene, sphere_.options_, sphere_.planned_.techniques, ray, sampler,
                       sample_counts, nullptr, letters);
    }

   private:
    const SphereIntegrator& sphere_;
    const UnitContext& context_;
    const estimators::RadianceFunction<samplers::Sampler> radiance_;
    Probe probe_;
  };

  const SphereSettings settings_;
  const estimators::PathOptions options_;
  const Planned planned_;
  const bool letters_;
};

}  // namespace

Result<std::unique_ptr<Integrator>> make_sphere_integrator(const SettingsMap& settings,
                                                           const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const SphereSettings parsed, parse_settings<SphereSettings>(settings));
  estimators::PathOptions options = parsed.path.common.path_options();
  options.heuristic = heuristic_named(parsed.path.heuristic.value);
  options.min_edges = 1;  // a probe sees the lamps
  Planned planned = path::plan(options, features, parsed.path.common.full_plan());
  return std::unique_ptr<Integrator>(
      std::make_unique<SphereIntegrator>(parsed, options, std::move(planned), features.reads_letters));
}

}  // namespace candela::integrators
