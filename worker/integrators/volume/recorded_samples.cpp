#include "worker/integrators/volume/recorded_samples.h"

#include <variant>

#include "worker/estimators/edited_subpaths.h"
#include "worker/scene/objects.h"

namespace candela::integrators {
namespace {

// One form for all scenes, but for those with edits that select by more of the path than the vertex.
template <bool kE>
struct RecordingConfig
    : estimators::BidirectionalConfig<transport::EdgeContent::media, transport::Balance, RecordingSink> {
  static constexpr bool kEdits = kE;
};

}  // namespace

Result<estimators::PathOptions> recorded_options(const BdptSettings& settings) {
  if (settings.regularise.on())
    return usage_error("mollified connections are in no report of paths")
        .with_field("regularise")
        .with_mend("leave out regularise=on: the report has the paths that bdpt samples");
  return settings.common.path_options();
}

struct RecordedSamples::Estimator {
  using Plain = estimators::Bidirectional<RecordingConfig<false>>;
  using Edited = estimators::Bidirectional<RecordingConfig<true>>;

  Estimator(const RecordedLight& recorded, std::uint32_t film_width, double film_pixels,
            const estimators::PathOptions& options, const estimators::Techniques& which, std::uint64_t seed,
            PathConsumer& paths)
      : of(recorded),
        width(film_width),
        techniques(which),
        // The density of eye paths is that over the film.
        counts{film_pixels, recorded.light_paths, static_cast<float>(recorded.filter.radius())},
        sink(of, paths),
        // Samples of a sequence are not independent, which the errors need.
        eye(samplers::SamplerKind::independent, seed),
        light(samplers::SamplerKind::independent, seed) {
    if (of.scene.objects().path_edits != nullptr)
      bidirectional.emplace<std::unique_ptr<Edited>>(
          std::make_unique<Edited>(of.scene, options, techniques, counts, sink, sample_counts));
    else
      bidirectional.emplace<std::unique_ptr<Plain>>(
          std::make_unique<Plain>(of.scene, options, techniques, counts, sink, sample_counts));
  }

  const RecordedLight of;
  const std::uint32_t width;
  const estimators::Techniques techniques;
  const estimators::PathCounts counts;
  film::SampleCounts sample_counts;
  RecordingSink sink;
  samplers::Sampler eye, light;
  std::variant<std::unique_ptr<Plain>, std::unique_ptr<Edited>> bidirectional;
};

RecordedSamples::RecordedSamples(const RecordedLight& light, std::uint32_t width, double film_pixels,
                                 const estimators::PathOptions& options,
                                 const estimators::Techniques& techniques, std::uint64_t seed,
                                 PathConsumer& paths)
    : estimator_(std::make_unique<Estimator>(light, width, film_pixels, options, techniques, seed, paths)) {}
RecordedSamples::~RecordedSamples() = default;

void RecordedSamples::trace(std::uint32_t x, std::uint32_t y, std::uint32_t half, std::uint64_t index) {
  Estimator& e = *estimator_;
  if (e.techniques.light_paths) {
    e.light.start_light(half, index, std::uint64_t{y} * e.width + x);
    std::visit([&](auto& bidirectional) { bidirectional->trace_light(e.light); }, e.bidirectional);
  }
  e.eye.start(half, index, x, y);
  e.eye.set_dimension(0);
  float filter_weight = 1, response = 1;
  const Vec2 offset = e.of.filter.sample(e.eye.next_2d(), filter_weight);
  const scene::Scene& scene = e.of.scene;
  const Ray ray =
      scene.camera_ray(static_cast<float>(x) + 0.5f + offset.x, static_cast<float>(y) + 0.5f + offset.y,
                       scene.reads_lens() ? e.eye.next_2d() : Vec2{0.5f, 0.5f}, response);
  e.sink.start_eye(ray, filter_weight * response, e.eye.sample_key());
  std::visit([&](auto& bidirectional) { bidirectional->trace_eye(ray, e.eye); }, e.bidirectional);
}

}  // namespace candela::integrators
