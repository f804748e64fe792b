// The errors of decided prefixes (prefixes.h) of a job that ends by its error. The job's checkpoints hold
// them, so that film and history belong together.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/stages/prefixes.h"

namespace candela::master {

struct ErrorHistory {
  std::vector<DecidedPrefix> prefixes;  // in order

  // Takes the place of what was known of this prefix and of longer ones.
  void decide(const DecidedPrefix& prefix);
  std::string serialise() const;
  // Fails (input) on anything but what serialise() made. Bytes that follow are passed over: builds before had
  // the movement of the image there.
  static Result<ErrorHistory> parse(std::string_view bytes);
  // Nothing in it where there are no such bytes.
  static ErrorHistory of(const std::string* bytes);
};

}  // namespace candela::master
