#include "common/wire/grpc_settings.h"

#include <cstdlib>

namespace candela::wire {

void configure_grpc() {
  // gRPC's own log is for its developers; our errors say what happened.
  ::setenv("GRPC_VERBOSITY", "NONE", 0);
  // A channel that lost its peer connects again in the background, but gRPC looks at that connection only
  // while a call waits for it, and calls fail at once meanwhile. Its spare poller looks every 5 s by default:
  // workers and clients would meet a master that is back in 0.3 s only seconds later.
  ::setenv("GRPC_CLIENT_CHANNEL_BACKUP_POLL_INTERVAL_MS", "200", 0);
}

}  // namespace candela::wire
