// The samples of jobs whose units record paths: an iteration is a sample of each pixel whose light is taken.
#pragma once

#include <utility>
#include <vector>

#include "common/base/work_monitor.h"
#include "worker/integrators/integrator.h"
#include "worker/integrators/parallel_tasks.h"
#include "worker/integrators/planned.h"
#include "worker/integrators/volume/recorded_samples.h"
#include "worker/integrators/volume/recorded_settings.h"

namespace candela::integrators {

class RecordedJob {
 public:
  // Errors (usage): pixels that are not on the film, light that no technique samples.
  static Result<RecordedJob> create(const RecordedSettings& settings, const scene::SceneFeatures& features);

  const Plan& plan() const { return planned_.plan; }

  // make(sample_counts) is the PathConsumer of a task, with start(half, index), called before each sample.
  template <class Make>
  Result<void> run(const UnitContext& context, const Unit& unit, film::UnitFilm& film, const RunContext& run,
                   const Make& make) const {
    const PixelRect rect = settings_.pixels();
    const RecordedLight light = light_of(context, context.letters);
    constexpr std::uint64_t kPixels = 64;  // of a task
    return for_each_task((rect.count() + kPixels - 1) / kPixels, film, run,
                         [&](std::uint64_t task, film::SampleCounts& sample_counts) {
                           auto consumer = make(sample_counts);
                           RecordedSamples samples = samples_of(light, context, consumer);
                           const std::uint64_t begin = task * kPixels,
                                               end = std::min(begin + kPixels, rect.count());
                           for (std::uint64_t pixel = begin; pixel < end; ++pixel)
                             for (std::uint64_t index = unit.begin; index < unit.end; ++index) {
                               if (run.stopped()) return;
                               consumer.start(unit.half, index);
                               trace(samples, rect, pixel, unit.half, index);
                             }
                           sample_counts.eye_samples += (end - begin) * (unit.end - unit.begin);
                         });
  }

  // Traces `count` samples of pixels of a fixed random choice, for a pilot.
  void sample_some(const UnitContext& context, std::uint32_t count, PathConsumer& consumer) const;

 private:
  RecordedJob(const RecordedSettings& settings, const estimators::PathOptions& options, Planned planned)
      : settings_(settings), options_(options), planned_(std::move(planned)) {}

  RecordedLight light_of(const UnitContext& context, const transport::PathLetters* letters) const;
  RecordedSamples samples_of(const RecordedLight& light, const UnitContext& context,
                             PathConsumer& paths) const;
  static void trace(RecordedSamples& samples, const PixelRect& rect, std::uint64_t pixel, std::uint32_t half,
                    std::uint64_t index);

  RecordedSettings settings_;
  estimators::PathOptions options_;
  Planned planned_;
};

}  // namespace candela::integrators
