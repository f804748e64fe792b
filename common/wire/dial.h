// Channels to a master.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "common/wire/wire.h"

namespace candela::wire {

struct DialOptions {
  std::string master;  // HOST:PORT; errors name it --master
  TlsFiles tls;
  std::optional<Role> role = {};  // that the caller's certificate must have
  // For a master without TLS; empty: the one that this user's master made.
  std::filesystem::path token_file = {};
  bool insecure = false;  // allow a master beyond loopback without TLS
  int max_receive_bytes = 64 << 20;
  int min_backoff_ms = 200;  // between attempts to connect
  int max_backoff_ms = 2000;
  // The time one attempt to connect may take: TCP, TLS and HTTP/2 are four round trips.
  int attempt_ms = 20000;
};

// Returns at once; the channel connects when it is used.
Result<std::shared_ptr<grpc::Channel>> dial(const DialOptions& options);

}  // namespace candela::wire
