// Result of one call of the program.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "client/embedded/app.h"
#include "tests/temporary_folder.h"

namespace candela::client {

struct Outcome {
  int code;
  std::string out, err;
};

// Calls the program in this process. `words`: without its name.
inline Outcome run_candela(std::vector<std::string> words) {
  words.insert(words.begin(), "candela");
  std::ostringstream out, err;
  const int code = run_program(words, out, err);
  return {code, out.str(), err.str()};
}

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
