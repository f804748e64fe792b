// The committed table of verdicts: tests/proofs/proved.txt. A line says that a test passed in full with films
// of these digests. tests/nightly/prove alone writes lines: each ends in a check of itself, so that a line
// that was edited or merged by hand is refused.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace candela::proofs {

struct Line {
  std::string test;    // Suite.Name, or Suite.Name#Part
  std::string films;   // digest of the films of the first batches
  std::string judge;   // digest of what judges them: the test's source and the arithmetic
  std::string commit;  // at which the full form passed
};

struct Table {
  std::string build;  // compiler and instruction set of the build that proved the lines
  std::vector<Line> lines;
  const Line* find(std::string_view test) const;
};

std::string line_text(const Line& line);
// Fails (input) with file and line at a line that line_text() did not make, and at a test that stands twice.
Result<Table> read_table(const std::string& path);
// The compiler and the instruction set of this build.
std::string this_build();

}  // namespace candela::proofs
