#include "client/embedded/inspect_farm.h"

#include <fmt/format.h>

#include <ostream>

#include "client/output.h"
#include "client/passing_folder.h"
#include "client/submission.h"
#include "client/values.h"
#include "common/film/counts.h"

namespace candela::client {

Result<JobRun> run_job(Context& context, const FarmOptions& options, std::string name,
                       const LoadedScene& scene, const WaitOptions& wait) {
  JobRun run;
  CANDELA_ASSIGN(run.farm, connect(options));
  Submission submission;
  submission.name = std::move(name);
  Submitted submitted;
  {
    ProgressLine progress(context.err, ProgressLine::mode_for(wait.quiet));
    CANDELA_ASSIGN(submitted, submit_scene(*run.farm, scene, context.facts, submission, progress));
  }
  run.id = submitted.job_id;
  context.err << fmt::format("candela: job {}\n", printable(run.id)) << std::flush;
  CANDELA_ASSIGN(run.code, wait_for_job(context, *run.farm, run.id, wait));
  return run;
}

Result<JobFile> run_job_to(Context& context, const FarmOptions& options, InspectJob job, LoadedScene scene,
                           const std::string& file) {
  JobSettings& settings = scene.job.settings = std::move(job.settings);
  CANDELA_ASSIGN(settings.integrator_settings,
                 context.facts.complete_settings(settings.integrator, {}, settings.integrator_settings));
  scene.job.stop = {};
  scene.job.stop.iterations = job.iterations;
  scene.job.indices = {};
  CANDELA_ASSIGN(const JobRun run, run_job(context, options, std::move(job.name), scene,
                                           {.quiet = job.quiet, .output = {file, {}}}));
  JobFile made;
  made.code = run.code;
  if (made.code != 0) return made;
  CANDELA_ASSIGN(const v1::JobStatus status, run.farm->get_job(run.id));
  for (const v1::RejectedSamples& rejected : status.rejected())
    if (rejected.cause() == film::name(film::RejectCause::not_a_number) ||
        rejected.cause() == film::name(film::RejectCause::infinite))
      made.not_finite += rejected.count();
  return made;
}

Result<JobImage> run_inspect_job(Context& context, const FarmOptions& options, InspectJob job,
                                 LoadedScene scene, const inspect::Session& session) {
  job.settings.layers = session.selects() ? letters::text_of(session.request()) : std::string();
  CANDELA_ASSIGN(const PassingFolder folder, PassingFolder::make());
  const std::string file = (folder.path() / "job.exr").string();
  CANDELA_ASSIGN(const JobFile job_file,
                 run_job_to(context, options, std::move(job), std::move(scene), file));
  JobImage made;
  made.code = job_file.code;
  made.not_finite = job_file.not_finite;
  if (made.code != 0) return made;
  CANDELA_ASSIGN(made.image, session.selects()
                                 ? image::read_layer(file, session.request().layers.front().name)
                                 : image::read_image(file));
  return made;
}

}  // namespace candela::client
