// Waiting for several jobs, or for all frames of groups.
#pragma once

#include <vector>

#include "client/commands/on_end.h"
#include "client/commands/waiting.h"

namespace candela::client {

// One line of progress for all, until all have ended. Exit code: 0 if all are done, else 1; 128+n where a
// signal ended the waiting. `ended`: how each has ended, if no signal came.
Result<int> wait_for_jobs(Context& context, FarmClient& farm, const std::vector<v1::JobName>& jobs,
                          bool quiet, bool json, std::vector<EndedJob>& ended);

// The image of each, by the names that `output` and `png` make of {name}, {id} and {frame}. `request`: which
// image and layers.
struct FetchPlan {
  std::optional<std::string> output, png;
  ImageRequest request;
  bool quiet = false, denoise = false;
  std::optional<image::Mix> mix = {};
};
Result<int> fetch_jobs(Context& context, FarmClient& farm, const std::vector<v1::JobName>& jobs,
                       const FetchPlan& plan);

}  // namespace candela::client
