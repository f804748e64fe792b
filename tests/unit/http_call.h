// One request over HTTP to a server on loopback, as a test wrote it.
#pragma once

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <string>

#include "common/base/descriptor.h"

namespace candela::test {

// Returns the whole answer; of a stream its head and its beginning.
inline std::string http_call(int port, const std::string& text) {
  const Descriptor socket(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  EXPECT_EQ(::connect(socket.get(), reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  const timeval patience{30, 0};
  ::setsockopt(socket.get(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  for (std::size_t sent = 0; sent < text.size();) {
    const ssize_t n = ::send(socket.get(), text.data() + sent, text.size() - sent, MSG_NOSIGNAL);
    if (n <= 0) break;  // it has answered before it had all
    sent += static_cast<std::size_t>(n);
  }
  std::string out;
  char buffer[65536];
  ssize_t n = 0;
  while ((n = ::recv(socket.get(), buffer, sizeof buffer, 0)) > 0) {
    out.append(buffer, static_cast<std::size_t>(n));
    if (out.find("text/event-stream") != std::string::npos && out.find("\n\n") != std::string::npos) break;
  }
  return out;
}

}  // namespace candela::test
