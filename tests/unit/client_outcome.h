// What one call of the program left.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <string>

#include "tests/temporary_folder.h"

namespace candela::client {

struct Outcome {
  int code;
  std::string out, err;
};

// Commands run with an empty configuration, whatever the machine's own is.
class CommandTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::ofstream(folder_.path() / "config.toml") << "";
    ::setenv("CANDELA_CONFIG", (folder_.path() / "config.toml").c_str(), 1);
    ::unsetenv("CANDELA_MASTER");
  }
  void TearDown() override { ::unsetenv("CANDELA_CONFIG"); }

  test::TemporaryFolder folder_;
};

}  // namespace candela::client
