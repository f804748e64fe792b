#include "client/submission.h"

#include <fmt/format.h>

#include <map>

#include "client/values.h"
#include "common/base/files.h"
#include "common/base/text.h"
#include "common/stages/decision.h"
#include "common/stages/memory_need.h"
#include "common/wire/json.h"
#include "common/wire/token.h"
#include "common/wire/wire.h"

namespace candela::client {
namespace {

// Uploads what the farm lacks, and submits. The bytes uploaded go to `total`.
Result<v1::SubmitResponse> upload_and_submit(FarmClient& farm, const LoadedScene& scene,
                                             const Submission& submission, const v1::SubmitRequest& request,
                                             ProgressLine& progress, std::uint64_t& total) {
  // Equal files under two keys are one blob.
  std::map<std::string, const bundle::File*> blobs;
  for (const bundle::File& file : scene.gathered.bundle.files) blobs.emplace(file.sha256, &file);
  std::vector<std::string> hashes;
  for (const auto& [hash, file] : blobs) hashes.push_back(hash);
  CANDELA_ASSIGN(const std::vector<std::string> missing, farm.find_missing(hashes));

  total = 0;
  for (const std::string& hash : missing) {
    if (!blobs.contains(hash)) return internal_error("the master misses a file we did not ask about");
    total += blobs.at(hash)->size_bytes;
  }
  std::uint64_t before = 0;
  for (const std::string& hash : missing) {
    const bundle::File& file = *blobs.at(hash);
    const auto path = scene.gathered.real_paths.find(file.path);
    if (path == scene.gathered.real_paths.end())
      return internal_error(
          fmt::format("the bundle's file '{}' has no place on this disk", printable(file.path)));
    if (!submission.take || !submission.take(file, path->second).ok())
      CANDELA_TRY(farm.upload_blob(hash, file.size_bytes, path->second, [&](std::uint64_t sent) {
        progress.show(fmt::format("uploading {} of {}", format_bytes(before + sent), format_bytes(total)));
      }));
    before += file.size_bytes;
  }
  progress.clear();

  return farm.submit(request);
}

// Before anything is uploaded. The scene is loaded only if its settings leave the answer open.
Result<void> check_limits(FarmClient& farm, const LoadedScene& scene, const RendererFacts& facts) {
  const JobSettings& settings = scene.job.settings;
  WorkPlan largest;
  if (facts.largest_work) {
    CANDELA_ASSIGN(largest, facts.largest_work(settings));
  }
  CANDELA_ASSIGN(const v1::GetServerInfoResponse master, farm.check_server());
  const auto fits = [&](const WorkPlan& work) -> Result<void> {
    if (!work.accumulators.empty()) {
      CANDELA_TRY(validate(work, settings.width, settings.height));
      CANDELA_TRY(check_statistics(work, settings, master.statistics_limit_bytes()));
    }
    if (master.memory_limit_bytes() == 0) return {};
    return check_memory(memory_need(work, settings.width, settings.height), settings,
                        master.memory_limit_bytes());
  };
  auto any_scene = fits(largest);
  if (any_scene.ok() || !facts.work_of) return any_scene;
  CANDELA_ASSIGN(const WorkPlan work, facts.work_of(scene));
  return fits(work);
}

v1::SubmitRequest request_of(const LoadedScene& scene, const Submission& submission) {
  v1::SubmitRequest request;
  request.set_name(submission.name);
  wire::to_proto(scene.gathered.bundle, *request.mutable_bundle());
  wire::to_proto(scene.job.settings, *request.mutable_settings());
  wire::to_proto(scene.job.stop, scene.job.indices, *request.mutable_stop());
  // A path that cannot be shown is not told; the job is the same without.
  if (escape_unprintable(scene.path) == scene.path && scene.path.size() <= Limits::max_path_bytes)
    request.set_scene_path(scene.path);
  if (submission.frame) *request.mutable_frame() = *submission.frame;
  request.mutable_depends()->Assign(submission.depends.begin(), submission.depends.end());
  request.set_priority(submission.priority);
  request.set_share(submission.share);
  request.set_submitter(wire::user_at_host());
  request.set_idempotency_token(submission.token.empty() ? random_token() : submission.token);
  return request;
}

}  // namespace

Result<void> export_submission(const LoadedScene& scene, const Submission& submission,
                               const std::filesystem::path& folder) {
  CANDELA_TRY(make_directories(folder));
  for (const bundle::File& file : scene.gathered.bundle.files) {
    const std::filesystem::path target = folder / file.sha256;
    std::error_code error;
    std::filesystem::copy_file(scene.gathered.real_paths.at(file.path), target,
                               std::filesystem::copy_options::overwrite_existing, error);
    if (error) return resource_error("cannot be written: " + error.message()).at(target.string(), 0);
  }
  return write_file_atomically(folder / "submission.json",
                               wire::submission_json(request_of(scene, submission)) + "\n");
}

Result<Submitted> submit_scene(FarmClient& farm, const LoadedScene& scene, const RendererFacts& facts,
                               const Submission& submission, ProgressLine& progress) {
  CANDELA_TRY(check_limits(farm, scene, facts));
  const v1::SubmitRequest request = request_of(scene, submission);
  std::uint64_t uploaded = 0;
  auto response = upload_and_submit(farm, scene, submission, request, progress, uploaded);
  // The farm may have found damage in a file only now, and lack it since.
  if (!response.ok() && response.error().kind == ErrorKind::refused &&
      response.error().field == "bundle.files")
    response = upload_and_submit(farm, scene, submission, request, progress, uploaded);
  if (!response.ok()) return std::move(response).error();
  return Submitted{response->job_id(), response->existed(), uploaded, response->group_id()};
}

}  // namespace candela::client
