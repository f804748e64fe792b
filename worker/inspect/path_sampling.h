// The samples of bidirectional path tracing for some pixels, in tasks: which paths they find, each with all
// of its vertices.
#pragma once

#include <cstdint>

#include "common/base/result.h"
#include "worker/estimators/options.h"
#include "worker/inspect/session.h"
#include "worker/integrators/volume/recorded_samples.h"

namespace candela::inspect {

// Sample i is that of iteration i of a job, and of batch i mod batches(). A task is a stretch of the pixels,
// row by row, in one batch.
class PathSampling {
 public:
  // The settings of the session's job are those of `bdpt`. Errors: settings. The session outlives it.
  static Result<PathSampling> create(const Session& session, const PixelRect& pixels, std::uint64_t spp);

  std::uint64_t batches() const { return batches_; }
  std::uint64_t task_count() const { return batches_ * stretches_; }
  std::uint64_t batch_of(std::uint64_t task) const { return task % batches_; }
  // Samples of each pixel.
  std::uint64_t samples_in(std::uint64_t batch) const { return (spp_ - batch + batches_ - 1) / batches_; }

  // A pure function of its arguments; from any thread.
  void run(std::uint64_t task, PathConsumer& paths) const;

 private:
  PathSampling(const Session& session, const PixelRect& pixels, std::uint64_t spp,
               const estimators::PathOptions& options, const estimators::Techniques& techniques);

  const Session* session_;
  PixelRect pixels_;
  std::uint64_t spp_, batches_, pixels_each_, stretches_;
  estimators::PathOptions options_;
  estimators::Techniques techniques_;
};

}  // namespace candela::inspect
