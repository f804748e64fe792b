// A bundle from the bytes that the master's store keeps of it.
#pragma once

#include <string>

#include "common/base/result.h"
#include "common/job/bundle.h"

namespace candela::wire {

// bytes: canonical() of a v1::Bundle. Errors (input): they are none, or not a valid one.
Result<bundle::Bundle> parse_bundle(const std::string& bytes);

}  // namespace candela::wire
