// The layers of a job's AOVs: means of merged sums.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/image/image.h"
#include "master/merge/job_film.h"
#include "master/store/records.h"

namespace candela::master {

// One layer for each AOV of the job; mattes have more. Its values are sums over what `which` says, divided by
// the number of iterations, or of the pixel's eye samples where the job counts them; zero where there is no
// sample. The rows of the layers read the snapshot: it must live as long as they do. A matte
// (common/image/cryptomatte.h) has one of a preview, colored by id, and one for each two ranks, whose
// coverage is such a mean.
Result<std::vector<image::Layer>> aov_layers(const JobRow& row, const JobFilm::Snapshot& snapshot,
                                             film::MergedFilm::Which which);

// Adds the attributes of the job's mattes.
void describe_mattes(const JobRow& row, std::map<std::string, std::string>& attributes);

}  // namespace candela::master
