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
  bool error_layer = false;
  ImageOutput output = {};  // fetched at the end, where given
  PreviewOptions preview = {};
  bool variance_layer = false;
  bool chain_layers = false;
  std::string estimator = {};
  v1::FetchImageRequest::Half half = v1::FetchImageRequest::HALF_UNSPECIFIED;
  std::string on_end = {};  // a command to run when the job has ended; empty: none
};

// The value of --half, which excludes layers that both halves make.
Result<v1::FetchImageRequest::Half> parse_half(const std::optional<std::string>& text, bool error_layer,
                                               bool variance_layer);

// Exit code: the job's result, or 128+n where a signal ended the waiting (the job goes on).
Result<int> wait_for_job(Context& context, FarmClient& farm, const std::string& id,
                         const WaitOptions& options);

}  // namespace candela::client
