#include "tests/bench/candela_study/image_errors.h"

#include <utility>

namespace candela::study {
namespace {

// Mean over values of (a - b)(c - d).
double product(const Image& a, const Image& b, const Image& c, const Image& d) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    sum += (static_cast<double>(a[i]) - static_cast<double>(b[i])) *
           (static_cast<double>(c[i]) - static_cast<double>(d[i]));
  return sum / static_cast<double>(a.size());
}

}  // namespace

Truth::Truth(Image one, Image other) : first(std::move(one)), second(std::move(other)) {
  for (const Image* reference : {&first, &second})
    for (const float value : *reference)
      mean += static_cast<double>(value) / (2 * static_cast<double>(reference->size()));
  variance = product(first, second, first, second) / 2 / (mean * mean);
}

Pattern::Pattern(const Truth& truth, Image one, const Image& other)
    : biased(std::move(one)),
      square(product(other, truth.first, biased, truth.second) / (truth.mean * truth.mean)) {}

ImageErrors errors_of(const std::vector<Image>& images, const Truth& truth) {
  const double unit = truth.mean * truth.mean;
  const auto seeds = static_cast<double>(images.size());
  const Image mean = mean_image(images, 0, images.size());
  ImageErrors errors;
  std::vector<double> with_others;
  for (const Image& image : images) {
    const double squared = product(image, truth.first, image, truth.second) / unit;
    errors.squared_error.add(squared);
    if (images.size() < 2) continue;
    errors.variance.add(product(image, mean, image, mean) / unit * seeds / (seeds - 1));
    // Sum for this image with all others: seeds * (mean - R2) is the sum over all.
    const double with_all = seeds * product(image, truth.first, mean, truth.second) / unit;
    with_others.push_back((with_all - squared) / (seeds - 1));
  }
  // Pseudo-values of the jackknife: their mean is the mean over pairs. Each pair is in two images' means, so
  // the spread of these would be too small an error.
  const double pairs = statistical::moments_of(with_others).mean();
  for (const double others : with_others) {
    const double without = seeds > 2 ? (seeds * pairs - 2 * others) / (seeds - 2) : pairs;
    errors.squared_bias.add(seeds * pairs - (seeds - 1) * without);
  }
  return errors;
}

ImageErrors errors_of(const std::vector<Image>& images, const Truth& truth, const Pattern& pattern) {
  ImageErrors errors = errors_of(images, truth);
  const double unit = truth.mean * truth.mean * pattern.square;
  for (const Image& image : images)
    errors.amplitude.add(product(image, truth.first, pattern.biased, truth.second) / unit);
  return errors;
}

double relative_squared_error(const Image& image, const Truth& truth) {
  double sum = 0;
  for (std::size_t i = 0; i < image.size(); ++i) {
    const auto one = static_cast<double>(truth.first[i]), other = static_cast<double>(truth.second[i]),
               value = static_cast<double>(image[i]);
    const double reference = (one + other) / 2;
    sum += (value - one) * (value - other) / (reference * reference + 0.01 * truth.mean * truth.mean);
  }
  return sum / static_cast<double>(image.size());
}

Image mean_image(const std::vector<Image>& images, std::size_t begin, std::size_t end) {
  std::vector<double> sum(images[begin].size());
  for (std::size_t k = begin; k < end; ++k)
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += static_cast<double>(images[k][i]);
  Image mean;
  for (const double value : sum) mean.push_back(static_cast<float>(value / static_cast<double>(end - begin)));
  return mean;
}

}  // namespace candela::study
