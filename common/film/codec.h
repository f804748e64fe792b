// Bytes of films: little-endian fields, a checksum, and tiles as compressed byte planes. Used by deltas and
// checkpoints.
//
// Sums of Monte Carlo noise have low bytes that do not compress and high bytes that nearly vanish. Split into
// planes (byte p of the zigzag integer of every pixel of a group of tiles, one channel at a time) each kind
// meets the coder alone: zero planes cost nothing, noise is stored, the rest goes through zstd.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/film/counts.h"
#include "common/film/layout.h"

namespace candela::film {

// XXH64 with seed 0 [Collet, xxHash specification 0.1.1]: against accidents, not against attackers.
std::uint64_t checksum(std::string_view bytes);

constexpr std::uint64_t zigzag(std::int64_t value) {
  return (static_cast<std::uint64_t>(value) << 1) ^ static_cast<std::uint64_t>(value >> 63);
}
constexpr std::int64_t unzigzag(std::uint64_t code) {
  return static_cast<std::int64_t>((code >> 1) ^ (~(code & 1) + 1));
}

void put_u8(std::string& out, std::uint8_t value);
void put_u16(std::string& out, std::uint16_t value);
void put_u32(std::string& out, std::uint32_t value);
void put_u64(std::string& out, std::uint64_t value);

// Reads fields off the front of a view. After the first read beyond the end, ok() is false and all reads give
// zero.
class Reader {
 public:
  explicit Reader(std::string_view bytes) : rest_(bytes) {}
  std::uint8_t u8() { return static_cast<std::uint8_t>(number(1)); }
  std::uint16_t u16() { return static_cast<std::uint16_t>(number(2)); }
  std::uint32_t u32() { return static_cast<std::uint32_t>(number(4)); }
  std::uint64_t u64() { return number(8); }
  std::string_view bytes(std::size_t count);
  bool ok() const { return ok_; }
  std::string_view rest() const { return rest_; }

 private:
  std::uint64_t number(std::size_t count);
  std::string_view rest_;
  bool ok_ = true;
};

void put_layout(std::string& out, const Layout& layout, int scale_log2);
// 11 u64. The first form had 7: neither statistics that were rejected, nor merges. The second had 10: no
// walks that were ended by a bound.
enum class SampleCountsForm : std::uint8_t { first, second, present };
void put_sample_counts(std::string& out, const SampleCounts& sample_counts);
SampleCounts read_sample_counts(Reader& reader, SampleCountsForm form = SampleCountsForm::present);

// Appends the checksum of everything in `out`.
void seal(std::string& out);
// The bytes between the magic and the checksum. Fails (input) on another magic, truncation or change; `what`
// names it.
Result<std::string_view> unseal(std::string_view bytes, std::string_view magic, std::string_view what);

// Ascending tile indices as runs.
void put_tiles(std::string& out, std::span<const std::uint32_t> tiles);
// Fails unless they ascend strictly below tile_count and the runs are maximal.
Result<std::vector<std::uint32_t>> read_tiles(Reader& reader, std::size_t tile_count);

// Tiles are coded in groups of this many (32 KiB a plane): large enough for zstd, small enough for the cache.
inline constexpr std::size_t kGroupTiles = 32;

// One channel of a group of tiles as byte planes: plane p holds byte p of each zigzag integer. Planes of
// zeros are absent.
struct PlaneSet {
  static constexpr int kMaxPlanes = 16;
  std::size_t values = 0;
  std::uint32_t present = 0;  // bit p: plane p is in `bytes`, lowest first, `values` bytes each
  std::shared_ptr<const std::uint8_t[]> bytes;
};

// Holds the compressor's memory between calls.
class PlaneWriter {
 public:
  PlaneWriter();
  ~PlaneWriter();
  PlaneWriter(const PlaneWriter&) = delete;
  PlaneWriter& operator=(const PlaneWriter&) = delete;
  // Appends zigzag integers of 64 bits, or 128 if `high` is not empty (then of the same size).
  void put(std::string& out, std::span<const std::uint64_t> low, std::span<const std::uint64_t> high);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

class PlaneReader {
 public:
  PlaneReader();
  ~PlaneReader();
  PlaneReader(const PlaneReader&) = delete;
  PlaneReader& operator=(const PlaneReader&) = delete;
  // Reads `values` integers of at most max_planes bytes.
  Result<PlaneSet> read(Reader& reader, std::size_t values, int max_planes);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// Integers [first, first + out.size()) of a set; the planes from 8 up are the high words.
void expand_low(const PlaneSet& set, std::size_t first, std::span<std::uint64_t> out);
void expand_high(const PlaneSet& set, std::size_t first, std::span<std::uint64_t> out);
// True if any of them is not zero.
bool any(const PlaneSet& set, std::size_t first, std::size_t count);

}  // namespace candela::film
