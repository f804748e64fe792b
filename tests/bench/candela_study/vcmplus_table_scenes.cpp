// Scenes of the study vcmplus-table, their references, and errors against them.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "tests/bench/candela_study/kept.h"
#include "tests/bench/candela_study/vcmplus_table.h"

namespace candela::study {
namespace {

double luminance_at(const Image& image, std::size_t pixel) {
  return 0.212671 * static_cast<double>(image[3 * pixel]) +
         0.715160 * static_cast<double>(image[3 * pixel + 1]) +
         0.072169 * static_cast<double>(image[3 * pixel + 2]);
}

}  // namespace

std::span<const TableScene> table_scenes() {
  static const std::vector<TableScene> scenes = {
      {"cornell-box", "../shared/scenes/cornell-box/scene.xml", "path", 2048},
      {"veach-mis", "../shared/scenes/veach-mis/scene.xml", "path", 4096, false, false, 1},
      {"veach-bidir", "../shared/scenes/veach-bidir/scene.xml", "bdpt", 2048, false, false, 1},
      {"veach-ajar", "../shared/scenes/veach-ajar/scene.xml", "bdpt", 2048, false, false, 1},
      {"caustic", "tests/statistical/transport/caustic.xml", "bdpt", 2048},
      {"slide", "tests/bench/candela_study/scenes/slide.xml", "path", 4096, true},
      {"sds", "tests/statistical/transport/sds.xml", "path", 4096},
      {"studio", "deploy/scenes/studio/scene.xml", "bdpt", 1024},
      {"torus", "tests/bench/torus/torus.xml", "path", 8192, true, true},
      {"lamp-in-glass", "tests/statistical/transport/lamp-in-glass.xml", "path", 4096, false, true},
      {"mirror-glossy", "tests/statistical/transport/mirror-glossy.xml", "path", 4096},
  };
  return scenes;
}

Result<TableTruth> TableTruth::render(const TableScene& scene, std::uint32_t side, std::uint64_t count,
                                      unsigned threads, const std::filesystem::path& folder) {
  std::vector<Image> references;
  for (const std::uint64_t seed : {900001, 900002}) {
    const std::string name = fmt::format("{}-{}-{}-{}-{}", scene.name, scene.reference, side, count, seed);
    CANDELA_ASSIGN(Image image,
                   kept_image(folder, name, std::size_t{side} * side * 3, [&]() -> Result<Image> {
                     CANDELA_ASSIGN(auto images, render_images({.scene = scene.file,
                                                                .width = side,
                                                                .height = side,
                                                                .integrator = scene.reference,
                                                                .seed = seed,
                                                                .sampler = "sobol",
                                                                .threads = threads},
                                                               {count}));
                     return std::move(images[0]);
                   }));
    references.push_back(std::move(image));
  }
  return TableTruth(std::move(references[0]), std::move(references[1]));
}

TableTruth::TableTruth(Image one, Image other) : first_(std::move(one)), second_(std::move(other)) {
  const std::size_t pixels = first_.size() / 3;
  double mean = 0, mean_luminance = 0;
  for (const Image* reference : {&first_, &second_}) {
    for (const float value : *reference)
      mean += static_cast<double>(value) / (2 * static_cast<double>(reference->size()));
    for (std::size_t i = 0; i < pixels; ++i)
      mean_luminance += luminance_at(*reference, i) / (2 * static_cast<double>(pixels));
  }
  per_square_ = 1 / (mean * mean);
  for (std::size_t i = 0; i < pixels; ++i) {
    const double here = std::max(0.0, (luminance_at(first_, i) + luminance_at(second_, i)) / 2);
    weights_.push_back(1 / (here * here + 0.01 * mean_luminance * mean_luminance));
  }
}

double TableTruth::squared_error(const Image& image) const {
  double sum = 0;
  for (std::size_t i = 0; i < image.size(); ++i)
    sum += (static_cast<double>(image[i]) - static_cast<double>(first_[i])) *
           (static_cast<double>(image[i]) - static_cast<double>(second_[i]));
  return sum * per_square_ / static_cast<double>(image.size());
}

std::vector<double> TableTruth::relative_errors(const Image& image) const {
  std::vector<double> errors(weights_.size());
  for (std::size_t i = 0; i < image.size(); ++i)
    errors[i / 3] += (static_cast<double>(image[i]) - static_cast<double>(first_[i])) *
                     (static_cast<double>(image[i]) - static_cast<double>(second_[i])) * weights_[i / 3] / 3;
  return errors;
}

double TableTruth::relative_error(const Image& image) const {
  return trimmed_mean(relative_errors(image), 0);
}

double TableTruth::trimmed_error(const Image& image) const {
  return trimmed_mean(relative_errors(image), 0.01);
}

double TableTruth::relative_bias(const std::vector<Image>& images) const {
  const auto seeds = static_cast<double>(images.size());
  double sum = 0;
  for (std::size_t i = 0; i < first_.size(); ++i) {
    // The sum over all pairs, less the pairs of an image with itself.
    double to_first = 0, to_second = 0, with_itself = 0;
    for (const Image& image : images) {
      const double a = static_cast<double>(image[i]) - static_cast<double>(first_[i]),
                   b = static_cast<double>(image[i]) - static_cast<double>(second_[i]);
      to_first += a;
      to_second += b;
      with_itself += a * b;
    }
    sum += (to_first * to_second - with_itself) * weights_[i / 3];
  }
  return sum / (seeds * (seeds - 1)) / static_cast<double>(first_.size());
}

double TableTruth::variance() const {
  double sum = 0;
  for (std::size_t i = 0; i < first_.size(); ++i) {
    const double d = static_cast<double>(first_[i]) - static_cast<double>(second_[i]);
    sum += d * d / 2;
  }
  return sum * per_square_ / static_cast<double>(first_.size());
}

double TableTruth::relative_variance() const {
  double sum = 0;
  for (std::size_t i = 0; i < first_.size(); ++i) {
    const double d = static_cast<double>(first_[i]) - static_cast<double>(second_[i]);
    sum += d * d / 2 * weights_[i / 3];
  }
  return sum / static_cast<double>(first_.size());
}

double median(std::vector<double> values) {
  if (values.empty()) return kNone;
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : (values[middle - 1] + values[middle]) / 2;
}

double trimmed_mean(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  const auto kept =
      values.size() - static_cast<std::size_t>(std::ceil(share * static_cast<double>(values.size())));
  double sum = 0;
  for (std::size_t i = 0; i < kept; ++i) sum += values[i];
  return kept > 0 ? sum / static_cast<double>(kept) : kNone;
}

double reached(const std::vector<double>& places, const std::vector<double>& errors, double target) {
  for (std::size_t k = 0; k < errors.size(); ++k) {
    if (errors[k] > target) continue;
    if (k == 0) return places[0];
    if (errors[k] <= 0) return kNone;  // within the noise of the references
    const double share = std::log(errors[k - 1] / target) / std::log(errors[k - 1] / errors[k]);
    return places[k - 1] * std::pow(places[k] / places[k - 1], share);
  }
  return kNone;
}

}  // namespace candela::study
