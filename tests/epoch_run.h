// A job of iterations without a farm: units in this process, and, if the integrator has epochs, states that
// are decided between them from the sums of whole epochs, as the master does.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/film/accumulator.h"
#include "common/film/counts.h"
#include "common/film/index_set.h"
#include "common/film/layout.h"
#include "common/stages/decision.h"
#include "common/stages/epochs.h"
#include "worker/render/renderer.h"

namespace candela::test {

// The states of a job, and the sums that they follow from. A job without epochs has none, and every unit is
// possible at any time.
class EpochRun {
 public:
  // `pilot`: as the renderer answered it, or with another film scale.
  EpochRun(const render::Renderer& renderer, const PilotResult& pilot);

  // The same units cut at the borders of epochs, those of earlier epochs first, else in this order.
  std::vector<Unit> cut(const std::vector<Unit>& units) const;
  // The job's iterations [from, to) of both halves; iteration i is index i / 2 of half i % 2.
  std::vector<Unit> units(std::uint64_t from, std::uint64_t to) const;

  // The input of a unit: the pilot's state, and that of its epoch, which is decided now if it has not been.
  // Fails (internal) if units of the epochs that it depends on are missing. Valid as long as this object.
  Result<render::UnitInput> input(const Unit& unit);
  // Adds the statistics of a rendered unit to those of its epoch. Fails (internal) if one of its indices has
  // been added.
  Result<void> add(const Unit& unit, const render::UnitOutput& output);
  // Both, with run() between them, on an output of make_output() that is clear.
  Result<void> run(const Unit& unit, render::UnitOutput& output, const render::RunContext& context);

  const std::optional<EpochPlan>& plan() const { return plan_; }
  // The accumulators of a job's deltas.
  const std::vector<film::AccumulatorSpec>& accumulators() const { return accumulators_; }
  // States of epochs 0, 1, ..., as far as they are decided.
  const std::deque<std::string>& states() const { return states_; }
  const Carry& carry() const { return carry_; }
  // Note of the rule on the last state; empty if there is none, or nothing to tell.
  Result<StateReport> describe(bool with_layers) const;

  // All of the above as bytes, for a run that goes on in another process.
  std::string save() const;
  // Fails (input) on anything but what save() of a run of this job gave.
  Result<void> restore(std::string_view saved);

 private:
  struct OpenEpoch {
    std::vector<film::MergedAccumulator> sums;  // as Carry::sums
    std::array<film::IndexSet, 2> indices;
  };
  OpenEpoch& open_epoch(std::uint64_t epoch);
  Result<void> decide_next();

  const render::Renderer& renderer_;
  NamedState state_;  // the pilot's
  std::optional<EpochPlan> plan_;
  std::optional<Epochs> epochs_;
  film::Layout layout_;
  std::vector<film::AccumulatorSpec> accumulators_;
  std::deque<std::string> states_;  // a state that is lent does not move
  Carry carry_;
  std::map<std::uint64_t, OpenEpoch> open_;
};

// Sums of the film of a job.
struct JobSums {
  film::Layout layout;
  int scale_log2 = 0;
  struct Half {
    std::vector<std::int64_t> sums;  // [layer][y][x][channel], as a UnitFilm's
    film::SampleCounts sample_counts;
    std::uint64_t iterations = 0;
  };
  std::array<Half, 2> halves;
  std::deque<std::string> states;

  film::SampleCounts sample_counts() const;  // of both halves
  // Means over all iterations: width * height * 3 values of one layer.
  std::vector<double> mean(std::size_t layer) const;
};

// Renders iterations [0, iterations) of a job. Without epochs each half is one unit.
Result<JobSums> render_job(const render::Renderer& renderer, const PilotResult& pilot,
                           std::uint64_t iterations, const render::RunContext& context);

}  // namespace candela::test
