// Places of the stand-ins of Open Image Denoise (fake_oidn.cpp).
#pragma once

#include <string>

#include "tests/paths.h"

namespace candela::test {

// version: 1 or 2.
inline std::string fake_oidn(int version) {
  const std::string number = std::to_string(version);
  return program_path("oidn_" + number + "/libOpenImageDenoise.so." + number).string();
}

}  // namespace candela::test
