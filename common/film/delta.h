// The film of one unit as a worker hands it in: its bytes, and their checked form.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/film/codec.h"
#include "common/film/counts.h"
#include "common/film/layout.h"
#include "common/job/job.h"

namespace candela::film {

class UnitFilm;

// Identifies a delta; checked against the lease before it is merged.
struct DeltaInfo {
  Unit unit;
  Layout layout;
  int scale_log2 = 0;
  std::string job_id;
  std::string build_id;
};

// Wire form of a unit's film: header, tallies, touched tiles compressed (byte planes of zigzag integers,
// zstd), checksum. Deterministic: films of equal sums and tallies give equal bytes. Preconditions: the film
// has not overflowed; the ids have at most Limits::max_name_bytes; info's layout and scale are ignored in
// favour of the film's.
std::string encode_delta(const UnitFilm& film, const DeltaInfo& info);

// A checked, decoded delta.
class Delta {
 public:
  // Fails on anything that is not the whole and unchanged output of encode_delta: wrong magic, length,
  // checksum, tile index, decompressed size, trailing bytes. Memory is bounded by the layout in `expected`,
  // which must match.
  static Result<Delta> decode(std::string_view bytes, const Layout& expected);
  const DeltaInfo& info() const { return info_; }
  const Tallies& tallies() const { return tallies_; }

 private:
  friend class MergedFilm;
  // Consecutive entries of tiles_, kept as byte planes (a third of the memory of the sums) until they are
  // merged.
  struct Group {
    std::size_t first = 0, count = 0;
    std::array<PlaneSet, kChannels> channels;
  };
  DeltaInfo info_;
  Tallies tallies_;
  std::vector<std::uint32_t> tiles_;  // ascending indices
  std::vector<Group> groups_;
};

}  // namespace candela::film
