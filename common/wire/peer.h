// The client at the other end of a connection, for limits of one client: the address without the port, and
// the user if the address is this machine's, since all of its users have it.
#pragma once

#include <sys/socket.h>

#include <string>
#include <string_view>

namespace candela::wire {

// Reads gRPC's text for a peer: "ipv4:10.0.0.7:1234", "ipv6:%5B::1%5D:1234", "ipv6:[::1]:1234". Another text
// is the name itself.
std::string peer_name(std::string_view grpc_peer);
std::string peer_name(const sockaddr_storage& address);

// The same where /proc/net/tcp and /proc/net/tcp6 have these texts: for tests.
std::string peer_name(std::string_view host, int port, const std::string& tcp, const std::string& tcp6);

}  // namespace candela::wire
