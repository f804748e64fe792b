// Jobs of `candela inspect` on a farm.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "client/commands/waiting.h"
#include "client/context.h"
#include "client/settings.h"
#include "common/image/image.h"
#include "worker/inspect/session.h"

namespace candela::client {

struct InspectJob {
  std::string name;  // of the job
  JobSettings settings;
  std::uint64_t iterations = 0;
  bool quiet = false;
};

struct JobImage {
  int code = 0;                  // 0, the job's exit code, or 128+n if a signal ended the waiting
  image::Image image;            // if the code is 0: of the light that the session selects
  std::uint64_t not_finite = 0;  // rejected samples
};

struct JobFile {
  int code = 0;                  // 0, the job's, or 128+n if a signal ended the waiting
  std::uint64_t not_finite = 0;  // rejected samples
};

struct JobRun {
  std::unique_ptr<FarmClient> farm;
  std::string id;
  int code = 0;  // as JobFile's
};
// Submits the scene's job as it is, tells its id, and waits for its end.
Result<JobRun> run_job(Context& context, const FarmOptions& farm, std::string name, const LoadedScene& scene,
                       const WaitOptions& wait);
// Submits the job of the scene, waits for its end, and writes its image with all layers to `file`. The job's
// settings of its integrator are completed.
Result<JobFile> run_job_to(Context& context, const FarmOptions& farm, InspectJob job, LoadedScene scene,
                           const std::string& file);
// The same with a layer of the light that the session selects, and reads the image. session: of the scene.
Result<JobImage> run_inspect_job(Context& context, const FarmOptions& farm, InspectJob job, LoadedScene scene,
                                 const inspect::Session& session);

}  // namespace candela::client
