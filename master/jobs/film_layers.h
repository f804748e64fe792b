// The layers of a job's film beyond its image: those of expressions, and those of the integrator.
#pragma once

#include <string>
#include <vector>

#include "common/film/development.h"
#include "common/film/merged_film.h"
#include "common/image/image.h"
#include "master/store/records.h"

namespace candela::master {

// In the order of the film; none before the pilot. A job of chains has one for two layers of its film.
std::vector<std::string> film_layer_names(const JobRow& row);

// The layers that add up to the image: those of a partition, or the light groups; else none.
std::vector<std::string> partition_of(const JobRow& row);

// One for each of film_layer_names(). The rows of the layers read `film` and `development`, which must live
// as long as they do.
std::vector<image::Layer> film_layers(const JobRow& row, const film::MergedFilm& film,
                                      const film::Development& development, film::MergedFilm::Which which);

}  // namespace candela::master
