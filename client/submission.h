// From a loaded scene to a job on a farm: find what the farm lacks, upload that, submit.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "client/farm_client.h"
#include "client/progress.h"
#include "client/settings.h"

namespace candela::client {

struct Submission {
  std::string name;
  std::int32_t priority = 0;
  double share = 1;
  std::optional<v1::Frame> frame;    // of a group
  std::vector<std::string> depends;  // ids
  std::string token;                 // idempotency; empty: a random one, so that our own retries are safe
  // Gives a farm of this process a file; null, or an error: it is uploaded.
  std::function<Result<void>(const bundle::File&, const std::filesystem::path&)> take = nullptr;
};

struct Submitted {
  std::string job_id;
  bool existed = false;  // an earlier call with this token made it
  std::uint64_t uploaded_bytes = 0;
  std::string group_id = {};
};

// Nothing is uploaded for a job whose statistics the master has no memory for.
Result<Submitted> submit_scene(FarmClient& farm, const LoadedScene& scene, const RendererFacts& facts,
                               const Submission& submission, ProgressLine& progress);

// Writes what submit_scene() would send: submission.json, and each scene file, called by its SHA-256.
Result<void> export_submission(const LoadedScene& scene, const Submission& submission,
                               const std::filesystem::path& folder);

}  // namespace candela::client
