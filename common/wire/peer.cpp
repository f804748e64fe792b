#include "common/wire/peer.h"

#include <arpa/inet.h>
#include <netinet/in.h>

#include <array>
#include <charconv>
#include <fstream>
#include <iterator>
#include <sstream>
#include <utility>

namespace candela::wire {
namespace {

std::string text_of(const char* file) {
  std::ifstream in(file);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

bool is_loopback(std::string_view host) {
  return host.starts_with("127.") || host == "::1" || host.starts_with("::ffff:127.");
}

// The user of the socket that has this port of this machine and is connected; -1: none is found. A line is
// "0: 0100007F:1F90 0100007F:C350 01 ... UID ...": local address, remote address, state, five fields before
// it.
long user_of(int port, const std::string& sockets) {
  std::istringstream lines(sockets);
  std::string line;
  std::getline(lines, line);  // the header
  while (std::getline(lines, line)) {
    std::istringstream fields(line);
    std::string number, local, remote, state, queues, timer, retransmits;
    long uid = -1;
    if (!(fields >> number >> local >> remote >> state >> queues >> timer >> retransmits >> uid)) continue;
    const std::size_t colon = local.find(':');
    int its_port = 0;
    if (colon == std::string::npos || state != "01") continue;
    std::from_chars(local.data() + colon + 1, local.data() + local.size(), its_port, 16);
    if (its_port == port) return uid;
  }
  return -1;
}

}  // namespace

std::string peer_name(std::string_view host, int port, const std::string& tcp, const std::string& tcp6) {
  if (!is_loopback(host)) return std::string(host);
  long uid = user_of(port, tcp);
  if (uid < 0) uid = user_of(port, tcp6);
  return uid < 0 ? std::string(host) : "user " + std::to_string(uid) + " of this machine";
}

std::string peer_name(std::string_view peer) {
  const bool v4 = peer.starts_with("ipv4:"), v6 = peer.starts_with("ipv6:");
  const std::size_t colon = peer.rfind(':');
  if ((!v4 && !v6) || colon < 5) return std::string(peer);
  std::string host(peer.substr(5, colon - 5));
  for (const auto& [coded, plain] : {std::pair("%5B", "["), std::pair("%5D", "]"), std::pair("%25", "%")})
    for (std::size_t at; (at = host.find(coded)) != std::string::npos;) host.replace(at, 3, plain);
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  int port = 0;
  std::from_chars(peer.data() + colon + 1, peer.data() + peer.size(), port);
  if (!is_loopback(host)) return host;
  return peer_name(host, port, text_of("/proc/net/tcp"), text_of("/proc/net/tcp6"));
}

std::string peer_name(const sockaddr_storage& address) {
  std::array<char, INET6_ADDRSTRLEN> text{};
  if (address.ss_family == AF_INET) {
    const auto& in = reinterpret_cast<const sockaddr_in&>(address);
    ::inet_ntop(AF_INET, &in.sin_addr, text.data(), text.size());
    return peer_name("ipv4:" + std::string(text.data()) + ":" + std::to_string(ntohs(in.sin_port)));
  }
  if (address.ss_family != AF_INET6) return "unknown";
  const auto& in = reinterpret_cast<const sockaddr_in6&>(address);
  ::inet_ntop(AF_INET6, &in.sin6_addr, text.data(), text.size());
  return peer_name("ipv6:[" + std::string(text.data()) + "]:" + std::to_string(ntohs(in.sin6_port)));
}

}  // namespace candela::wire
