// Exact sums over cells, from any thread: 128-bit fixed point. Integers add up to the same whatever the
// order, and the sums of parts add up to that of the whole.
#pragma once

#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace candela::inspect {

class CellSums {
 public:
  static constexpr std::uint64_t kBytesPerSum = 16;

  // May throw std::bad_alloc.
  explicit CellSums(std::uint64_t sums) : words_(2 * sums) {}

  // False, and nothing is added: the value is NaN or beyond 2^40 in magnitude. A value counts in units of
  // 2^-64, rounded toward 0.
  bool add(std::uint64_t sum, double value) {
    if (!(std::abs(value) <= 0x1p40)) return false;
    const auto units = static_cast<Wide>(static_cast<SignedWide>(value * 0x1p64));
    const auto low = static_cast<std::uint64_t>(units), high = static_cast<std::uint64_t>(units >> 64);
    const std::uint64_t before = word(2 * sum).fetch_add(low, std::memory_order_relaxed);
    const std::uint64_t carry = before + low < before ? 1 : 0;
    if (high + carry != 0) word(2 * sum + 1).fetch_add(high + carry, std::memory_order_relaxed);
    return true;
  }

  // Precondition of these: no thread adds.
  double value(std::uint64_t sum) const {
    return static_cast<double>(static_cast<SignedWide>(units(sum))) * 0x1p-64;
  }
  // Adds the sums of the same cells.
  void add(const CellSums& other) {
    for (std::size_t i = 0; i < words_.size() / 2; ++i) {
      const Wide total = units(i) + other.units(i);
      words_[2 * i] = static_cast<std::uint64_t>(total);
      words_[2 * i + 1] = static_cast<std::uint64_t>(total >> 64);
    }
  }
  bool operator==(const CellSums&) const = default;

 private:
  __extension__ using Wide = unsigned __int128;  // a GCC extension that -Wpedantic wants declared
  __extension__ using SignedWide = __int128;

  std::atomic_ref<std::uint64_t> word(std::uint64_t i) { return std::atomic_ref(words_[i]); }
  Wide units(std::uint64_t sum) const {
    return static_cast<Wide>(words_[2 * sum + 1]) << 64 | words_[2 * sum];
  }

  std::vector<std::uint64_t> words_;  // of each sum the lower 64 bits, then the upper
};

}  // namespace candela::inspect
