#include "worker/integrators/aov/aov_pass.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "worker/integrators/eye_samples.h"
#include "worker/integrators/pixel_order.h"
#include "worker/scene/objects.h"
#include "worker/transport/between.h"
#include "worker/transport/draws.h"
#include "worker/transport/scattering.h"

namespace candela::integrators {
namespace {

constexpr std::uint64_t kSamplesWord = 0x616f76;       // "aov": names the samples
constexpr std::uint64_t kOrderWord = 0x616f762070ULL;  // "aov p": names the order of pixels
// A value of 1 is 2^36 film units. A float of 2^-12 or more is then a whole number of them, a sample may be
// 2^20 times as large, and a unit may have 2^27 samples a pixel.
constexpr int kUnitScale = 36;
// Indices: up to 2^36.
constexpr int kIndexScale = 20;

// The surface that an eye sample sees.
struct Seen {
  scene::SurfaceHit hit;
  Spectrum albedo;
  double distance = 0;  // from the lens
  EyeRay eye{};
  Vec2 u_lens{0.5f, 0.5f};
};

// The scale of lengths that are at most about `extent`.
int length_scale(double extent) {
  int exponent = 0;
  if (extent > 0 && std::isfinite(extent)) std::frexp(extent, &exponent);
  return kUnitScale - exponent;
}

const scene::SceneObjects::Mattes& mattes_of(AovKind kind, const scene::SceneObjects& objects) {
  return kind == AovKind::crypto_object ? objects.object_mattes : objects.material_mattes;
}

// One thread's eye samples.
class Eye {
 public:
  Eye(const std::vector<Aov>& aovs, const UnitContext& context, UnitOutput& output,
      film::SampleCounts& sample_counts)
      : aovs_(aovs),
        context_(context),
        output_(output),
        sample_counts_(sample_counts),
        sampler_(context.sampler, rng::key(context.seed, kSamplesWord)) {
    const auto wants_albedo = [](const Aov& aov) { return aov.kind == AovKind::albedo; };
    reads_bsdf_ =
        context.scene.features().any_passthrough || std::any_of(aovs.begin(), aovs.end(), wants_albedo);
  }

  // Sample `index` of a pixel in a half. `shared`: other threads may add to the pixel.
  void add(std::uint32_t half, std::uint64_t index, std::uint32_t x, std::uint32_t y, bool shared) {
    sampler_.start(half, index, x, y);
    const EyeRay ray = eye_ray(context_, x, y, sampler_);
    Seen seen;
    seen.eye = ray;
    if (context_.scene.reads_lens()) {
      sampler_.set_dimension(1);  // as eye_ray() drew it
      seen.u_lens = sampler_.next_2d();
    }
    if (!look(ray.ray, seen)) return;
    std::array<double, 3> values{};
    for (std::size_t i = 0; i < aovs_.size(); ++i) {
      if (is_matte(aovs_[i].kind)) {
        const std::uint32_t key = mattes_of(aovs_[i].kind, context_.scene.objects()).of_shape[seen.hit.shape];
        output_.aovs[i]->add_key(x, y, key, static_cast<double>(ray.weight), sampler_.sample_key(),
                                 sample_counts_);
        continue;
      }
      const std::size_t count = values_of(aovs_[i].kind, seen, values);
      for (std::size_t c = 0; c < count; ++c) values[c] *= static_cast<double>(ray.weight);
      put(i, x, y, std::span(values).first(count), shared);
    }
  }
  // Counts the sample that was added last.
  void count(std::size_t accumulator, std::uint32_t x, std::uint32_t y) {
    const double one = 1;
    put(accumulator, x, y, {&one, 1}, true);
  }

 private:
  void put(std::size_t i, std::uint32_t x, std::uint32_t y, std::span<const double> values, bool shared) {
    film::UnitAccumulator& sums = *output_.aovs[i];
    if (shared)
      sums.splat(x, y, 0, values, sampler_.sample_key(), sample_counts_);
    else
      sums.add(x, y, 0, values, sampler_.sample_key(), sample_counts_);
  }

  // False: nothing is there.
  bool look(const Ray& camera_ray, Seen& seen) {
    const scene::Scene& scene = context_.scene;
    Ray ray = camera_ray;
    Spectrum passed(1.0f);
    for (std::uint32_t pass = 0; pass < transport::kMaxPasses; ++pass) {
      ++sample_counts_.rays;
      if (!scene.intersect(ray, seen.hit)) return false;
      if (!reads_bsdf_ || !passes(ray, pass, seen, passed)) {
        seen.distance =
            scene.near_distance(camera_ray) + length(Vec3d(seen.hit.p) - Vec3d(camera_ray.origin));
        return true;
      }
      ray = spawn_ray(seen.hit, ray.direction);
    }
    return false;
  }

  // True if the ray goes on straight. If not, the albedo: what a sample of the bsdf sends back into all
  // directions. Importance knows no factor of refraction, so glass has the albedo of its color.
  bool passes(const Ray& ray, std::uint32_t pass, Seen& seen, Spectrum& passed) {
    const Vec3 wo = seen.hit.shading.to_local(-ray.direction);
    arena_.clear();
    const scene::Closure closure = context_.scene.closure(seen.hit, wo, arena_);
    seen.albedo = {};
    if (closure.black) return false;
    const std::uint32_t block = transport::kEyeDimensions + pass * transport::kBlock;
    const bool stratified = pass < transport::kStratifiedVertices;
    const transport::SurfaceScattering at(seen.hit, closure, -ray.direction, wo);
    const float u_lobe = at.chooses_lobe() ? sampler_.draw_1d(block + transport::kLobe, stratified) : 0.0f;
    scene::BsdfSample sample;
    if (!at.sample(u_lobe, sampler_.draw_2d(block + transport::kDirection, stratified),
                   scene::TransportMode::importance, sample))
      return false;
    passed *= sample.weight;
    if (sample.passthrough) return true;
    seen.albedo = passed;
    return false;
  }

  // Returns how many there are.
  std::size_t values_of(AovKind kind, const Seen& seen, std::array<double, 3>& out) const {
    const auto vector = [&](Vec3 v) {
      out = {static_cast<double>(v.x), static_cast<double>(v.y), static_cast<double>(v.z)};
      return std::size_t{3};
    };
    const auto number = [&](double value) {
      out[0] = value;
      return std::size_t{1};
    };
    const scene::SurfaceHit& hit = seen.hit;
    switch (kind) {
      case AovKind::albedo:
        return vector({seen.albedo.r, seen.albedo.g, seen.albedo.b});
      case AovKind::depth:
        return number(seen.distance);
      case AovKind::position: {
        const Vec3d p = Vec3d(hit.p) + context_.scene.offset();
        out = {p.x, p.y, p.z};
        return 3;
      }
      case AovKind::uv:
        out = {static_cast<double>(hit.uv.x), static_cast<double>(hit.uv.y), 0};
        return 2;
      case AovKind::geo_normal:
        return vector(hit.ng);
      case AovKind::sh_normal:
        return vector(hit.shading.n);
      case AovKind::dp_du:
        return vector(hit.dp_du);
      case AovKind::dp_dv:
        return vector(hit.dp_dv);
      case AovKind::prim_index:
        return number(context_.scene.primitive_in_shape(hit));
      case AovKind::shape_index:
        return number(hit.shape + 1.0);
      case AovKind::coverage:
      case AovKind::crypto_object:
      case AovKind::crypto_material:
        return number(1);
      case AovKind::duv_dx:
        return uv_step(seen, 1, 0, out);
      case AovKind::duv_dy:
        return uv_step(seen, 0, 1, out);
      case AovKind::boundary_test:
        return number(context_.scene.boundary_test(hit, seen.eye.ray.direction));
    }
    return 0;
  }

  // Growth of u and v on the plane of the surface from here to the same place of the next pixel, as in
  // Mitsuba: d(u, v) is the least-squares solution of dp = dp_du du + dp_dv dv.
  std::size_t uv_step(const Seen& seen, float dx, float dy, std::array<double, 3>& out) const {
    out = {0, 0, 0};
    const scene::SurfaceHit& hit = seen.hit;
    float unused = 0;
    const Ray next = context_.scene.camera_ray(seen.eye.at.x + dx, seen.eye.at.y + dy, seen.u_lens, unused);
    const Vec3d n(hit.ng), p(hit.p), o(next.origin), d(next.direction), du(hit.dp_du), dv(hit.dp_dv);
    const Vec3d dp = o + d * (dot(n, p - o) / dot(n, d)) - p;
    const double a = dot(du, du), b = dot(du, dv), c = dot(dv, dv), determinant = a * c - b * b;
    const double x = dot(du, dp), y = dot(dv, dp);
    const double u = (c * x - b * y) / determinant, v = (a * y - b * x) / determinant;
    if (std::isfinite(u) && std::isfinite(v)) out = {u, v, 0};
    return 2;
  }

  const std::vector<Aov>& aovs_;
  const UnitContext& context_;
  UnitOutput& output_;
  film::SampleCounts& sample_counts_;
  samplers::Sampler sampler_;
  scene::ClosureArena arena_;
  bool reads_bsdf_ = false;
};

int scale_of(AovKind kind, const scene::SceneFeatures& features) {
  switch (kind) {
    case AovKind::depth:
    case AovKind::position:
    case AovKind::dp_du:
    case AovKind::dp_dv:
      return length_scale(
          std::max(static_cast<double>(features.largest_coordinate), static_cast<double>(features.radius)));
    case AovKind::prim_index:
    case AovKind::shape_index:
      return kIndexScale;
    case AovKind::albedo:
    case AovKind::uv:
    case AovKind::geo_normal:
    case AovKind::sh_normal:
    case AovKind::coverage:
    case AovKind::duv_dx:
    case AovKind::duv_dy:
    case AovKind::boundary_test:
    case AovKind::crypto_object:
    case AovKind::crypto_material:
      break;
  }
  return kUnitScale;
}

}  // namespace

bool AovPass::reads_parameters() const {
  return std::any_of(aovs_.begin(), aovs_.end(), [](const Aov& aov) {
    switch (aov.kind) {
      case AovKind::uv:
      case AovKind::dp_du:
      case AovKind::dp_dv:
      case AovKind::duv_dx:
      case AovKind::duv_dy:
      case AovKind::boundary_test:
        return true;
      default:
        return false;
    }
  });
}

std::vector<film::AccumulatorSpec> AovPass::accumulators(const scene::SceneFeatures& features,
                                                         const scene::SceneObjects& objects) const {
  std::vector<film::AccumulatorSpec> specs;
  for (const Aov& aov : aovs_) {
    film::AccumulatorSpec spec{accumulator_name(aov), 1, scale_of(aov.kind, features)};
    if (is_matte(aov.kind)) {
      spec.domain = film::AccumulatorSpec::Domain::keys;
      spec.key_names = mattes_of(aov.kind, objects).names;
    } else {
      spec.channels = static_cast<std::uint32_t>(channel_letters(aov.kind).size());
    }
    specs.push_back(std::move(spec));
  }
  if (any() && chains_) specs.push_back({std::string(kAovSamples), 1, 0});
  return specs;
}

std::string AovPass::plan_text() const {
  return any() ? fmt::format("aovs: {}; by eye samples of their own, as many as the integrator's{}\n",
                             text_of(aovs_),
                             reads_parameters() ? ", in a copy of the scene whose hits all have uv" : "")
               : std::string();
}

Result<void> AovPass::run(const UnitContext& context, const Unit& unit, UnitOutput& output,
                          const RunContext& run) const {
  RunContext quiet = run;  // progress is the integrator's
  quiet.progress = nullptr;
  if (!any() || !makes_film(unit.kind)) return {};
  return unit.kind == Unit::Kind::segments ? run_segments(context, unit, output, quiet)
                                           : run_iterations(context, unit, output, quiet);
}

Result<void> AovPass::run_iterations(const UnitContext& context, const Unit& unit, UnitOutput& output,
                                     const RunContext& run) const {
  return for_each_tile(context.width, context.height, *output.film, run,
                       [&](std::uint32_t x0, std::uint32_t y0, std::uint32_t x1, std::uint32_t y1,
                           film::SampleCounts& sample_counts) {
                         Eye eye(aovs_, context, output, sample_counts);
                         for (std::uint32_t y = y0; y < y1; ++y)
                           for (std::uint32_t x = x0; x < x1; ++x) {
                             for (std::uint64_t index = unit.begin; index < unit.end; ++index) {
                               if (run.stopped()) return;
                               eye.add(unit.half, index, x, y, false);
                             }
                           }
                       });
}

Result<void> AovPass::run_segments(const UnitContext& context, const Unit& unit, UnitOutput& output,
                                   const RunContext& run) const {
  const std::uint64_t samples = chains_->segment_mutations;
  const PixelOrder order(std::uint64_t{context.width} * context.height,
                         rng::key(context.seed, kOrderWord, unit.half));
  return for_each_task(unit.end - unit.begin, *output.film, run,
                       [&](std::uint64_t task, film::SampleCounts& sample_counts) {
                         Eye eye(aovs_, context, output, sample_counts);
                         const std::uint64_t first = (unit.begin + task) * samples;
                         std::uint64_t at = order.place(first);
                         for (std::uint64_t i = 0; i < samples; ++i) {
                           if (i % 64 == 0 && run.stopped()) return;
                           const auto x = static_cast<std::uint32_t>(at % context.width);
                           const auto y = static_cast<std::uint32_t>(at / context.width);
                           eye.add(unit.half, order.round(first + i), x, y, true);
                           eye.count(aovs_.size(), x, y);
                           at = order.next(at);
                         }
                       });
}

}  // namespace candela::integrators
