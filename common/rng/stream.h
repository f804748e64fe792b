// Random numbers named by what they are for: (job seed, unit, index). Nothing in Candela draws from anywhere
// else, so any sample can be made again on any machine.
#pragma once

#include <cstdint>

namespace candela::rng {

// A bijective finaliser of good avalanche (Steele, Lea, Flood 2014: SplitMix64's).
constexpr std::uint64_t mix64(std::uint64_t x) {
  x ^= x >> 30;
  x *= 0xbf58476d1ce4e5b9ULL;
  x ^= x >> 27;
  x *= 0x94d049bb133111ebULL;
  x ^= x >> 31;
  return x;
}

// Combines a key with one more word; order matters.
constexpr std::uint64_t combine(std::uint64_t key, std::uint64_t word) {
  return mix64(key * 0x9e3779b97f4a7c15ULL + word + 0x632be59bd9b4e019ULL);
}

template <class... Words>
constexpr std::uint64_t key(std::uint64_t first, Words... rest) {
  std::uint64_t k = mix64(first + 0x9e3779b97f4a7c15ULL);
  ((k = combine(k, static_cast<std::uint64_t>(rest))), ...);
  return k;
}

// Uniform in [0, 1), all 24 bits exact, never 1.
constexpr float to_float(std::uint32_t bits) {
  return static_cast<float>(bits >> 8) * 0x1p-24f;
}
constexpr double to_double(std::uint64_t bits) {
  return static_cast<double>(bits >> 11) * 0x1p-53;
}

// The stream of one key: SplitMix64 from it.
class Stream {
 public:
  explicit constexpr Stream(std::uint64_t stream_key) : state_(stream_key) {}
  constexpr std::uint64_t next_u64() {
    state_ += 0x9e3779b97f4a7c15ULL;
    return mix64(state_);
  }
  constexpr std::uint32_t next_u32() { return static_cast<std::uint32_t>(next_u64() >> 32); }
  constexpr float next_float() { return to_float(next_u32()); }
  constexpr double next_double() { return to_double(next_u64()); }

 private:
  std::uint64_t state_;
};

}  // namespace candela::rng
