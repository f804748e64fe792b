// The film that the master adds up. Integers add the same in any order, so merging is commutative and
// associative, and idempotence comes from the set of merged iterations kept beside the sums (law 3).
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/film/counts.h"
#include "common/film/index_set.h"
#include "common/film/layout.h"
#include "common/film/tile_sums.h"

namespace candela::film {

class Delta;

// The job's film: two halves, each exact sums, sample counts, and the set of merged indices.
class MergedFilm {
 public:
  // Precondition: validate(layout, scale_log2).
  MergedFilm(Layout layout, int scale_log2);

  const Layout& layout() const { return layout_; }
  int scale_log2() const { return scale_log2_; }

  // Adds a delta of iterations or segments. Refused, and nothing changed, if its layout or scale differ or
  // any of its indices is merged already. Nothing changes if memory runs out either: std::bad_alloc.
  Result<void> merge(const Delta& delta);
  // Adds another film of the same job (a relay's, or a shard's) under the same rules.
  Result<void> merge(const MergedFilm& other);

  const IndexSet& merged(std::uint32_t half) const { return halves_[half].merged; }
  const SampleCounts& sample_counts(std::uint32_t half) const { return halves_[half].sample_counts; }
  std::uint64_t iterations() const { return halves_[0].merged.count() + halves_[1].merged.count(); }

  // Checkpoint form: everything above, compressed, with a checksum. parse() accepts exactly what serialise()
  // makes. The second form replaces `out`, and uses its memory.
  std::string serialise() const;
  void serialise(std::string& out) const;
  static Result<MergedFilm> parse(std::string_view bytes);

  // A copy of the first layers alone, with the sample counts and the merged indices.
  MergedFilm first_layers(std::uint32_t count) const;

  // No sum of the first layers differs from zero.
  bool black(std::uint32_t layers) const;

  // Sum of one half in film units (128 bits).
  Int128 sum(std::uint32_t half, std::uint32_t layer, std::uint32_t x, std::uint32_t y, int channel) const;

  // Mean over iterations of one layer, both halves together or one of them: width * height * 3 floats, row by
  // row. The division is in double from the exact sums. Zero where nothing is merged.
  enum class Which { both, half0, half1 };
  std::vector<float> develop(std::uint32_t layer, Which which = Which::both) const;
  // The same for one row, before rounding to float. `out` has width * 3 values.
  void develop_row(std::uint32_t layer, std::uint32_t y, Which which, std::span<double> out) const;

 private:
  // Invariant: |sum| <= merged.count() * 2^63, so 128 bits cannot overflow (indices are below 2^40).
  struct Half {
    TileSums sums;
    IndexSet merged;
    SampleCounts sample_counts;
  };
  static void serialise_half(std::string& out, const Half& half);
  static Result<void> parse_half(Reader& reader, SampleCountsForm form, Half& half);

  Layout layout_;
  int scale_log2_;
  std::array<Half, 2> halves_;
};

}  // namespace candela::film
