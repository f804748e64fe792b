// A job as this process makes it, without a farm: film, accumulators and every decided state, from one unit
// for each half, or for each half of each epoch. A farm has to end with the same bytes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "common/stages/decision.h"
#include "master/merge/checkpoint.h"
#include "worker/integrators/unit_data.h"

namespace candela::farm {

struct LocalJob {
  WorkPlan work;
  film::MergedFilm film;
  master::Accumulators accumulators;  // of all epochs, also those that are folded
  std::vector<std::string> states;
  Carry carry;
  std::vector<chains::ChainRecord> records = {};  // of a job of chains, by chain: the renderer keeps them
};

// Renders a unit: of a job of chains, segments. `state`: that of its epoch; empty for a job without epochs.
using RenderUnit = std::function<integrators::UnitOutput(const Unit&, std::string_view state)>;

LocalJob local_job(const WorkPlan& work, const film::Layout& layout, int film_scale_log2,
                   std::uint64_t iterations, const RenderUnit& render);

// Expects that a checkpoint has the film, the carry, the open epochs' sums and the hashes of all states of
// the job, and that a replay of the decisions gives the states. Reports through GoogleTest.
void expect_checkpoint(const std::filesystem::path& file, const LocalJob& job);

}  // namespace candela::farm
