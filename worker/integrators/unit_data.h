// Input and output of a unit, beside scene and settings.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/chains/chains.h"
#include "common/film/accumulator.h"
#include "common/film/delta.h"
#include "common/film/unit_film.h"
#include "common/job/job.h"

namespace candela::integrators {

struct UnitInput {
  NamedState state;
  // Bytes of the decided states that the lease names, by name.
  std::map<std::string, std::string_view, std::less<>> states;
  // A unit of segments has one for each index, in order.
  std::span<const chains::ChainStart> starts;
};

struct UnitOutput {
  // Null for a unit that brings no film.
  std::unique_ptr<film::UnitFilm> film;
  // As in the integrator's plan of work; none for a unit that brings no film.
  std::vector<std::unique_ptr<film::UnitAccumulator>> accumulators;
  // Accumulators of the renderer's AOVs, which follow those of the integrator in the plan of work.
  std::vector<std::unique_ptr<film::UnitAccumulator>> aovs;
  // The unit's epoch, which accumulators for each epoch belong to.
  std::uint64_t epoch = 0;
  // A unit of segments brings one for each index that it has done, in order: the first ones, or all.
  std::vector<chains::ChainRecord> records;
  // A unit of bootstrap samples brings the contribution of each, in order.
  std::vector<float> table;
  // Counts of a unit that brings no film; a film has its own.
  film::SampleCounts counts;

  // A sum wrapped around: nothing of the unit may be used.
  bool overflowed() const {
    bool any = film != nullptr && film->overflowed();
    for (const auto& sums : accumulators) any |= sums->overflowed();
    for (const auto& sums : aovs) any |= sums->overflowed();
    return any;
  }
  // An accumulator of keys has more pairs than there is memory for: the same.
  bool overfull() const {
    return std::any_of(aovs.begin(), aovs.end(), [](const auto& sums) { return sums->overfull(); });
  }
  film::SampleCounts sample_counts() const { return film != nullptr ? film->sample_counts() : counts; }
  // Ready for the next unit; the memory of sums is kept.
  void clear() {
    if (film != nullptr) film->clear();
    for (const auto& sums : accumulators) sums->clear();
    for (const auto& sums : aovs) sums->clear();
    records.clear();
    table.clear();
    epoch = 0;
    counts = {};
  }
};

// The delta of a unit. Preconditions: no sum has overflowed; info's ids have at most Limits::max_name_bytes.
std::string encode_delta(const film::DeltaInfo& info, const UnitOutput& output);

}  // namespace candela::integrators
