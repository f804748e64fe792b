// The layers of a job's AOVs: means of merged sums.
#pragma once

#include <vector>

#include "common/base/result.h"
#include "common/image/image.h"
#include "master/merge/job_film.h"
#include "master/store/records.h"

namespace candela::master {

// One layer for each AOV of the job. Its values are sums over what `which` says, divided by the number of
// iterations, or of the pixel's eye samples where the job counts them; zero where there is no sample. The
// rows of the layers read the snapshot: it must live as long as they do.
Result<std::vector<image::Layer>> aov_layers(const JobRow& row, const JobFilm::Snapshot& snapshot,
                                             film::MergedFilm::Which which);

}  // namespace candela::master
