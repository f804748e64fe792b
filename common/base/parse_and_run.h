// A server's program around its run: is the CPU fit, what does the command line say; every way out is said on
// standard error.
#pragma once

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <new>
#include <string>
#include <vector>

#include "common/base/path_options.h"
#include "common/base/text.h"
#include "common/base/version.h"

namespace candela {

// The exit code: run()'s; 0 for --help and --version; 2 for a command line that cannot be; 1 where memory or
// the program failed.
template <class Run>
int parse_and_run(const char* program, CLI::App& app, int argc, char** argv, Run&& run) {
  if (const char* missing = missing_cpu_feature()) {
    std::fprintf(stderr, "%s: this CPU lacks %s, which this build needs\n", program, missing);
    return 1;
  }
  refuse_empty_paths(app);
  const std::vector<std::string> arguments(argv + 1, argv + std::max(argc, 1));
  if (const std::string bare = option_without_value(arguments); !bare.empty()) {
    std::fprintf(stderr, "%s: %s has no value (see --help)\n", program, bare.c_str());
    return 2;
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    std::fprintf(stderr, "%s: %s (see --help)\n", program, escape_unprintable(error.what()).c_str());
    return 2;
  }
  try {
    return run();
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "%s: out of memory\n", program);
  } catch (const std::exception& exception) {
    std::fprintf(stderr, "%s: internal error: %s\n", program, exception.what());
  }
  return 1;
}

}  // namespace candela
