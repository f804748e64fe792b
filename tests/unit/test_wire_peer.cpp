// The other end of a connection, as limits of one client count it.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>

#include "common/wire/peer.h"

namespace candela::wire {
namespace {

constexpr const char* kSockets =
    "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode\n"
    "   0: 0100007F:1F90 00000000:0000 0A 00000000:00000000 00:00000000 00000000   107        0 4711 1\n"
    "   1: 0100007F:C350 0100007F:1F90 06 00000000:00000000 00:00000000 00000000     0        0 0 3\n"
    "   2: 0100007F:C351 0100007F:1F90 01 00000000:00000000 00:00000000 00000000  1000        0 4713 1\n";

// Claim: clients of one address are one, whatever their ports; on this machine's own addresses each user is
// one.
TEST(Peer, IsAnAddressOrAUserOfThisMachine) {
  EXPECT_EQ(peer_name("ipv4:10.0.0.7:1234"), "10.0.0.7");
  EXPECT_EQ(peer_name("ipv4:10.0.0.7:4321"), "10.0.0.7");
  EXPECT_EQ(peer_name("ipv6:%5B2001:db8::7%5D:1234"), "2001:db8::7");
  EXPECT_EQ(peer_name("ipv6:[2001:db8::7]:1234"), "2001:db8::7");
  EXPECT_EQ(peer_name("unknown"), "unknown");
  EXPECT_EQ(peer_name("127.0.0.1", 0xC351, kSockets, ""), "user 1000 of this machine");
  EXPECT_EQ(peer_name("::1", 0xC351, "", kSockets), "user 1000 of this machine");
  EXPECT_EQ(peer_name("10.0.0.7", 0xC351, kSockets, ""), "10.0.0.7");
  EXPECT_EQ(peer_name("127.0.0.1", 0xC350, kSockets, ""), "127.0.0.1") << "that connection is over";
  EXPECT_EQ(peer_name("127.0.0.1", 1, "nonsense", ""), "127.0.0.1");
}

// Claim: a connection of this process is its user's.
TEST(Peer, FindsItsOwnUser) {
  const int listener = ::socket(AF_INET, SOCK_STREAM, 0), client = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  ASSERT_EQ(::bind(listener, reinterpret_cast<sockaddr*>(&address), size), 0);
  ASSERT_EQ(::listen(listener, 1), 0);
  ASSERT_EQ(::getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size), 0);
  ASSERT_EQ(::connect(client, reinterpret_cast<sockaddr*>(&address), size), 0);
  sockaddr_storage peer{};
  socklen_t peer_size = sizeof peer;
  const int accepted = ::accept(listener, reinterpret_cast<sockaddr*>(&peer), &peer_size);
  ASSERT_GE(accepted, 0);
  EXPECT_EQ(peer_name(peer), "user " + std::to_string(::getuid()) + " of this machine");
  for (const int fd : {accepted, client, listener}) ::close(fd);
}

}  // namespace
}  // namespace candela::wire
