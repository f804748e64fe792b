// The shares of `candela inspect paths` by a job on a farm.
#pragma once

#include "client/embedded/inspect_scene.h"
#include "worker/inspect/paths.h"

namespace candela::client {

struct SharesJob {
  std::string name;  // of the job
  bool quiet = false;
};

// Fails (usage) if a job cannot tell `rows` groups apart.
Result<void> check_rows(std::size_t rows, const OpenedScene& scene);

// The request for samples on this machine that find groups and key paths.
inspect::PathsRequest request_here(const inspect::PathsRequest& request);

// Replaces all sums in the report, which is that of request_here(), by those of a job on the farm. Exit code:
// 0, the job's, or 128+n if a signal ended the waiting.
Result<int> shares_on_farm(Context& context, const FarmOptions& farm, SharesJob job,
                           const inspect::PathsRequest& request, const OpenedScene& opened, LoadedScene scene,
                           inspect::PathsReport& report);

}  // namespace candela::client
