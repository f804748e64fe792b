// Address at which a process listens, or that it calls.
#pragma once

#include <string>
#include <string_view>

#include "common/base/result.h"

namespace candela::wire {

// HOST:PORT ("127.0.0.1:7070", "[::1]:7070", "localhost:7070"); port 0 is for listening only.
struct Address {
  std::string host;
  int port = 0;
  bool loopback = false;  // 127.0.0.0/8, ::1, localhost
  std::string text() const;
};
Result<Address> parse_address(std::string_view text, std::string_view option_name);

}  // namespace candela::wire
