// Parts that both services share.
#pragma once

#include <grpcpp/grpcpp.h>

#include <new>
#include <string>

#include "common/wire/wire.h"
#include "master/farm.h"

namespace candela::master {

inline grpc::Status not_found(const char* what, const std::string& id) {
  return {grpc::StatusCode::NOT_FOUND, std::string("there is no ") + what + " '" + id.substr(0, 64) + "'"};
}

inline grpc::Status stopping_status() {
  return {grpc::StatusCode::UNAVAILABLE, "the master is stopping"};
}

// Answers before the stream is read whole. On gRPC 1.51's in-process transport that leaves the sender's Write
// waiting for ever, so there the rest is read and forgotten first. On a network it must not be: the sender
// may be slow, and nobody says that it ever ends.
template <class Message>
grpc::Status answer_early(const grpc::ServerContext& context, grpc::ServerReader<Message>& reader,
                          const grpc::Status& status) {
  const std::string peer = context.peer();
  if (peer.starts_with("ipv4:") || peer.starts_with("ipv6:")) return status;
  Message rest;
  while (reader.Read(&rest)) {
  }
  return status;
}

// Wraps each handler: an exception is our own mistake or a lack of memory, and ends the
// call alone.
template <class F>
grpc::Status guarded(F&& handler) {
  try {
    return handler();
  } catch (const std::bad_alloc&) {
    return wire::to_status_with_retry(resource_error("the master is out of memory"), 1000);
  } catch (const std::exception& e) {
    return {grpc::StatusCode::INTERNAL, e.what()};
  }
}

}  // namespace candela::master
