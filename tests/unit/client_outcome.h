// What one call of the program left.
#pragma once

#include <string>

namespace candela::client {

struct Outcome {
  int code;
  std::string out, err;
};

}  // namespace candela::client
