#include "master/jobs/film_layers.h"

#include <cstdint>
#include <optional>
#include <span>

#include "common/chains/chains.h"
#include "common/letters/partition.h"

namespace candela::master {
namespace {

// Places of a layer in row.layers: its own, and that of the independent part that a job of chains adds.
struct LayerPlace {
  std::size_t own = 0;
  std::optional<std::size_t> rest;
};

std::vector<LayerPlace> places_of(const JobRow& row) {
  std::vector<LayerPlace> places;
  for (std::size_t i = row.chains ? chains::kImageLayers - 1 : 0; i < row.layers.size(); ++i) {
    if (row.chains && row.layers[i].ends_with(chains::kIndependentPart)) continue;
    places.push_back({i, row.chains ? chains::independent_part(row.layers, i) : std::nullopt});
  }
  return places;
}

}  // namespace

std::vector<std::string> film_layer_names(const JobRow& row) {
  std::vector<std::string> names;
  for (const LayerPlace& place : places_of(row)) names.push_back(row.layers[place.own]);
  return names;
}

std::vector<std::string> partition_of(const JobRow& row) {
  return letters::partition_of(row.settings.layers, film_layer_names(row));
}

std::vector<image::Layer> film_layers(const JobRow& row, const film::MergedFilm& film,
                                      const film::Development& development, film::MergedFilm::Which which) {
  std::vector<image::Layer> layers;
  for (const LayerPlace& place : places_of(row)) {
    const auto own = static_cast<std::uint32_t>(place.own) + 1;  // layer 0 of the film is the image
    image::Layer layer{row.layers[place.own], {}, {}};
    if (place.rest)
      layer.row = [&film, &development, which, own, rest = static_cast<std::uint32_t>(*place.rest) + 1](
                      std::uint32_t y, std::span<float> out) {
        std::vector<double> chains(out.size()), independent(out.size());
        film.develop_row(own, y, which, chains);
        film.develop_row(rest, y, which, independent);
        for (std::size_t v = 0; v < out.size(); ++v)
          out[v] = static_cast<float>(development.factor * chains[v] + independent[v]);
      };
    else
      layer.row = [&film, which, own](std::uint32_t y, std::span<float> out) {
        std::vector<double> mean(out.size());
        film.develop_row(own, y, which, mean);
        for (std::size_t v = 0; v < out.size(); ++v) out[v] = static_cast<float>(mean[v]);
      };
    layers.push_back(std::move(layer));
  }
  return layers;
}

}  // namespace candela::master
