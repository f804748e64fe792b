// See failure_causes.h.
#include "worker/service/failure_causes.h"

#include <fmt/format.h>

#include "common/wire/wire.h"

namespace candela::worker {

FailureCause cause_of_rendering(const Error& error) {
  switch (error.kind) {
    case ErrorKind::input:
    case ErrorKind::usage:
      return FailureCause::scene;
    case ErrorKind::resource:
      return FailureCause::place;
    case ErrorKind::unreachable:
      return FailureCause::network;
    case ErrorKind::failed:
    case ErrorKind::refused:
    case ErrorKind::internal:
      return FailureCause::worker;
  }
  return FailureCause::worker;
}

FailureCause cause_of_fetching(const Error& error) {
  switch (error.kind) {
    case ErrorKind::resource:
    case ErrorKind::input:
    case ErrorKind::usage:
      return FailureCause::place;
    case ErrorKind::failed:
    case ErrorKind::unreachable:
      return FailureCause::network;
    case ErrorKind::refused:
      return FailureCause::master;
    case ErrorKind::internal:
      return FailureCause::worker;
  }
  return FailureCause::worker;
}

Error fetch_error(const grpc::Status& status, const std::string& what) {
  const bool masters = status.error_code() == grpc::StatusCode::DATA_LOSS ||
                       status.error_code() == grpc::StatusCode::NOT_FOUND;
  Error error = wire::from_status(status);
  error.kind = masters ? ErrorKind::refused : ErrorKind::failed;
  error.message = fmt::format("cannot fetch {}: {}", what, error.message);
  return error;
}

FailureCause cause_of_delivery(const grpc::Status& status, FailureCause if_invalid) {
  return status.error_code() == grpc::StatusCode::INVALID_ARGUMENT ? if_invalid : FailureCause::network;
}

}  // namespace candela::worker
