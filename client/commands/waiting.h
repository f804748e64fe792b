// Waiting for a job on a farm, with progress, until it ends or a signal says to stop looking.
#pragma once

#include "client/context.h"
#include "client/output.h"
#include "client/preview/preview.h"
#include "client/progress.h"

namespace candela::client {

struct WaitOptions {
  bool quiet = false;
  bool json = false;  // the last status on standard output
  ImageRequest request = {};
  ImageOutput output = {};  // fetched at the end, where given
  PreviewOptions preview = {};
  std::string on_end = {};  // a command to run when the job has ended; empty: none
};

// Exit code: the job's result, or 128+n where a signal ended the waiting (the job goes on).
Result<int> wait_for_job(Context& context, FarmClient& farm, const std::string& id,
                         const WaitOptions& options);

}  // namespace candela::client
