// The text that decides a verdict: a test's own source and the arithmetic that it uses.
#pragma once

#include <string>

namespace candela::proofs {

// Digest of the test's source file (as __FILE__ names it) and of the sources of the arithmetic.
std::string judge_digest(const std::string& test_file);

}  // namespace candela::proofs
