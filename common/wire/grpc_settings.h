// Settings of gRPC that it reads from the environment alone.
#pragma once

namespace candela::wire {

// For the start of a program, before its first thread and its first channel. Values that the environment has
// already are kept.
void configure_grpc();

}  // namespace candela::wire
