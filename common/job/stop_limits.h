// The largest limits of a job's stop rule that mean anything.
#pragma once

namespace candela {

inline constexpr double kMaxStopSeconds = 10 * 365.25 * 86400;  // ten years
inline constexpr double kMaxStopRelmse = 1e6;

}  // namespace candela
