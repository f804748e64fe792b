// What both services share.
#pragma once

#include <grpcpp/grpcpp.h>

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

// Reads what a sender still sends, and forgets it. A call that ends before its stream is read leaves the
// sender's Write waiting for ever on gRPC 1.51's in-process transport. The place in the gate bounds how long
// this takes.
template <class Message>
grpc::Status after_drain(grpc::ServerReader<Message>& reader, const grpc::Status& status) {
  Message rest;
  while (reader.Read(&rest)) {
  }
  return status;
}

// What cannot be forgotten in a handler: an exception is our own mistake or a lack of memory, and ends the
// call alone.
template <class F>
grpc::Status guarded(F&& handler) {
  try {
    return handler();
  } catch (const std::bad_alloc&) {
    return {grpc::StatusCode::RESOURCE_EXHAUSTED, "the master is out of memory"};
  } catch (const std::exception& e) {
    return {grpc::StatusCode::INTERNAL, e.what()};
  }
}

}  // namespace candela::master
