// The `candela` command.
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <string>
#include <vector>

#include "client/embedded/app.h"
#include "common/base/version.h"

int main(int argc, char** argv) {
  if (const char* feature = candela::missing_cpu_feature()) {
    std::fprintf(stderr, "candela: error: this CPU lacks %s, for which this program was built\n", feature);
    return 2;
  }
  // gRPC's own log is for its developers; our errors say what happened.
  ::setenv("GRPC_VERBOSITY", "NONE", 0);
  std::signal(SIGXFSZ, SIG_IGN);  // a file size limit is an error of the write, as a full disk is
  return candela::client::run_program(std::vector<std::string>(argv, argv + argc), std::cout, std::cerr);
}
