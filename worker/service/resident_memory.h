// The memory that this process has.
#pragma once

#include <cstdint>

namespace candela::worker {

// Resident memory in bytes; 0 where it is unknown.
std::uint64_t resident_bytes();

}  // namespace candela::worker
