// The one place where errors of this worker get the cause by which the master judges them
// (common/job/failure.h). Exceptions of the renderer, and answers of the master that are no errors of ours,
// are named where they are met.
#pragma once

#include <grpcpp/grpcpp.h>

#include "common/base/result.h"
#include "common/job/failure.h"

namespace candela::worker {

// The cause of an error that the renderer gave while it read a scene or rendered a unit. An error of the
// cache is not the renderer's, though it comes through it: BundleSource::cache_error().
FailureCause cause_of_rendering(const Error& error);

// The cause of an error on the way of a scene's files from the master through the cache. Where the cache is
// the sink, its kinds are: resource and input for its disk, failed for bytes that are not what was asked for.
FailureCause cause_of_fetching(const Error& error);

// The error of a call that fetches from the master, of the kind by which cause_of_fetching() tells its cause.
Error fetch_error(const grpc::Status& status, const std::string& what);

// The cause of a failed call by which a result was to be delivered. INVALID_ARGUMENT means that the result
// itself is not one, which is `if_invalid`.
FailureCause cause_of_delivery(const grpc::Status& status, FailureCause if_invalid);

}  // namespace candela::worker
