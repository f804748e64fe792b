// All that one unit brings, as a worker hands it in: sections in one file with one header and one checksum.
//
// A unit of iterations brings its film, the job's accumulators and counts; one of segments also the records
// of its chains; one of bootstrap samples a table of contributions and counts. Whoever adds a kind of work
// chooses among sections, and the way of a delta through the farm stays the same.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/film/accumulator.h"
#include "common/film/counts.h"
#include "common/film/layout.h"
#include "common/film/sparse_sums.h"
#include "common/job/job.h"

namespace candela::film {

class UnitFilm;

enum class SectionKind : std::uint8_t { film = 1, accumulator = 2, records = 3, table = 4, counts = 5 };

// An epoch's number is below this.
inline constexpr std::uint64_t kMaxEpochs = 1ULL << 20;

// Identifies a delta; checked against the lease before it is merged. Layout and scale are the film's, and
// meaningless without one.
struct DeltaInfo {
  Unit unit;
  Layout layout;
  int scale_log2 = 0;
  std::string job_id;
  std::string build_id;
};

// Writes a delta section by section, in the order of the functions below. Deterministic: equal sums, records,
// tables and counts give equal bytes. Preconditions: no sum has overflowed; the ids have at most
// Limits::max_name_bytes; info's layout and scale are ignored in favor of the film's.
class DeltaWriter {
 public:
  explicit DeltaWriter(const DeltaInfo& info);
  void film(const UnitFilm& film);
  // In the order of the job's plan. `epoch`: 0 for an accumulator of the whole job.
  void accumulator(const UnitAccumulator& sums, std::uint64_t epoch);
  void records(std::string_view encoded);  // chains::encode
  void table(std::span<const float> values);
  void counts(const SampleCounts& sample_counts);
  std::string finish();

 private:
  void begin(SectionKind kind, std::string_view name, std::uint64_t epoch);
  void end();
  std::string out_;
  std::size_t section_ = 0;  // where the length of the open section is
};

// The delta of a unit of a job without accumulators. `records`: encoded, of a unit of segments.
std::string encode_delta(const UnitFilm& film, const DeltaInfo& info, std::string_view records = {});

// The parts of a job's deltas that do not follow from a unit's kind.
struct DeltaShape {
  DeltaShape(const Layout& layout, std::vector<AccumulatorSpec> specs = {})  // NOLINT: a film is a shape
      : film(layout), accumulators(std::move(specs)) {}
  Layout film;
  std::vector<AccumulatorSpec> accumulators;
};

// A checked, decoded delta.
class Delta {
 public:
  // Fails (input) on anything that is not the whole and unchanged output of a DeltaWriter: wrong magic,
  // length, checksum, tile index, decompressed size, trailing bytes; and on sections that a unit of its kind
  // does not have, or lacks. Memory is bounded by `expected`, which must match, and by the bytes themselves.
  static Result<Delta> decode(std::string_view bytes, const DeltaShape& expected);

  using AccumulatorSums = BroughtSums;
  const DeltaInfo& info() const { return info_; }
  const SampleCounts& sample_counts() const { return sample_counts_; }
  const SparseSums& film() const { return film_; }
  const std::vector<AccumulatorSums>& accumulators() const { return accumulators_; }  // as in the plan
  std::uint64_t accumulator_bytes() const { return accumulator_bytes_; }  // of those sections, encoded
  const std::string& records() const { return records_; }  // encoded; empty if there is no such section
  const std::vector<float>& table() const { return table_; }
  // SHA-256 of all that images follow from: the same from all who render the unit, whatever their compressors
  // make of it. Counts for people, such as that of rays, are left out.
  std::string content_sha256() const;

 private:
  Result<void> read_section(SectionKind kind, std::string_view name, std::uint64_t epoch,
                            std::string_view bytes, const DeltaShape& expected);
  DeltaInfo info_;
  SampleCounts sample_counts_;
  SparseSums film_;
  std::vector<AccumulatorSums> accumulators_;
  std::uint64_t accumulator_bytes_ = 0;
  std::string records_;
  std::vector<float> table_;
};

}  // namespace candela::film
