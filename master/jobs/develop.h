// Turns a job's film into its image, at the moment of a snapshot.
#pragma once

#include <string_view>

#include "common/base/result.h"
#include "common/film/development.h"
#include "common/stats/movement.h"
#include "master/merge/job_film.h"
#include "master/store/records.h"

namespace candela::master {

// By the counts of its chains, or by the job's development from its accumulators. `estimator`: one that the
// development offers; empty: the job's own. A job without a development has none to choose from (usage).
Result<film::Development> develop(const JobRow& row, const JobFilm::Snapshot& snapshot,
                                  std::string_view estimator);

// The bias of the image as its photons measure it (common/stats/inner_merges.h); empty: the job has no such
// sums.
stats::Movement::Bias measured_bias(const JobRow& row, const JobFilm::Snapshot& snapshot);

}  // namespace candela::master
