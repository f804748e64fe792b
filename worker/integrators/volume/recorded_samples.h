// Samples of bidirectional path tracing for some pixels, each path with all of its vertices.
//
// Every technique that can make a path makes it, and the balance heuristic weighs them, so the contributions
// of all techniques to one path add up to it once.
#pragma once

#include <cstdint>
#include <memory>

#include "worker/estimators/options.h"
#include "worker/integrators/bdpt/settings.h"
#include "worker/integrators/volume/recording_sink.h"

namespace candela::integrators {

// The options of recorded paths. Error (usage): light that no technique samples.
Result<estimators::PathOptions> recorded_options(const BdptSettings& settings);

// The records of one thread.
class RecordedSamples {
 public:
  // width: of the camera's film; film_pixels: of all of it. light, paths and techniques outlive this object.
  RecordedSamples(const RecordedLight& light, std::uint32_t width, double film_pixels,
                  const estimators::PathOptions& options, const estimators::Techniques& techniques,
                  std::uint64_t seed, PathConsumer& paths);
  ~RecordedSamples();
  RecordedSamples(const RecordedSamples&) = delete;
  RecordedSamples& operator=(const RecordedSamples&) = delete;

  // A path from the light and one from the eye, in the pixel: a pure function of the arguments.
  void trace(std::uint32_t x, std::uint32_t y, std::uint32_t half, std::uint64_t index);

 private:
  struct Estimator;
  std::unique_ptr<Estimator> estimator_;
};

}  // namespace candela::integrators
