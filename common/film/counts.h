// The counts that travel beside a film's sums.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace candela::film {

// Why a sample was kept out of the film.
enum class RejectCause : std::uint8_t { not_a_number, infinite, negative, saturated };
inline constexpr int kRejectCauses = 4;
std::string_view name(RejectCause cause);  // "nan", "infinite", "negative", "saturated"

// Additive counts that travel with the sums.
struct Tallies {
  std::uint64_t eye_samples = 0;
  std::uint64_t light_paths = 0;
  std::uint64_t rays = 0;
  std::array<std::uint64_t, kRejectCauses> rejected{};
  void add(const Tallies& other);
  bool operator==(const Tallies&) const = default;
};

}  // namespace candela::film
