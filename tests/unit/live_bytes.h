// Bytes of operator new that are alive in this program, and how many were at most: the test's binary
// links live_bytes.cpp.
#pragma once

#include <cstdint>

namespace candela::test {

std::uint64_t live_bytes();
// Since the last reset.
std::uint64_t peak_live_bytes();
void reset_peak_live_bytes();

}  // namespace candela::test
