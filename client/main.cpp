// The `candela` command.
#include <csignal>
#include <cstdio>
#include <iostream>
#include <string>
#include <vector>

#include "client/embedded/app.h"
#include "common/base/memory.h"
#include "common/base/version.h"
#include "common/wire/grpc_settings.h"

int main(int argc, char** argv) {
  candela::keep_freed_memory();  // `candela render` renders in this process
  if (const char* feature = candela::missing_cpu_feature()) {
    std::fprintf(stderr, "candela: error: this CPU lacks %s, for which this program was built\n", feature);
    return 2;
  }
  candela::wire::configure_grpc();
  std::signal(SIGXFSZ, SIG_IGN);  // a file size limit is an error of the write, as a full disk is
  return candela::client::run_program(std::vector<std::string>(argv, argv + argc), std::cout, std::cerr);
}
