// What comes to a verdict, as text: a test's own source and the arithmetic that it uses.
#pragma once

#include <string>

namespace candela::proofs {

// Of the test's source file (as __FILE__ names it) and of the sources of the arithmetic.
std::string judge_digest(const std::string& test_file);

}  // namespace candela::proofs
