// Settings that programs give gRPC by the environment.
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "common/wire/grpc_settings.h"

namespace candela::wire {
namespace {

constexpr const char* kPoll = "GRPC_CLIENT_CHANNEL_BACKUP_POLL_INTERVAL_MS";

// Claim: connections that come back are looked at several times a second, and an operator's own value stands.
TEST(GrpcSettings, LookAtConnectionsOftenUnlessTold) {
  ::unsetenv(kPoll);
  configure_grpc();
  ASSERT_NE(std::getenv(kPoll), nullptr);
  EXPECT_LE(std::stoi(std::getenv(kPoll)), 500);
  EXPECT_GT(std::stoi(std::getenv(kPoll)), 0);
  ::setenv(kPoll, "7000", 1);
  configure_grpc();
  EXPECT_STREQ(std::getenv(kPoll), "7000");
  ::unsetenv(kPoll);
}

}  // namespace
}  // namespace candela::wire
