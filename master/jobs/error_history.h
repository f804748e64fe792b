// The history that a job's error estimate needs beside the job's sums: the movement of its image, and the
// errors of decided prefixes (prefixes.h) of a job that ends by its error. The job's checkpoints hold it, so
// that film and history belong together.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/stages/prefixes.h"
#include "common/stats/movement.h"

namespace candela::master {

struct ErrorHistory {
  stats::Movement movement;             // of a job that merges
  std::vector<DecidedPrefix> prefixes;  // in order

  // Takes the place of what was known of this prefix and of longer ones.
  void decide(const DecidedPrefix& prefix);
  std::string serialise() const;
  // Fails (input) on anything but the whole of what serialise() made.
  static Result<ErrorHistory> parse(std::string_view bytes);
  // Nothing in it where there are no such bytes.
  static ErrorHistory of(const std::string* bytes);
};

}  // namespace candela::master
