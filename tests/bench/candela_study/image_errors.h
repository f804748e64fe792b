// Squared error, variance and bias of the images of independent seeds, relative to the mean of the truth,
// over all pixels and channels. With images I_s of S seeds, two independent unbiased references R1, R2, and a
// pattern P of the bias:
//   squared error   mean of (I_s - R1)(I_s - R2): the noise of the references is not in its expectation
//   variance        of one image, from the spread over seeds
//   squared bias    mean of (I_s - R1)(I_t - R2) over all pairs of different seeds s, t
//   amplitude       mean of (I_s - R1)(Q - R2) over that of (Q' - R1)(Q - R2): how much of the bias of the
//                   images Q and Q', independent of each other and of all others, the image I_s has
#pragma once

#include <cstddef>
#include <vector>

#include "tests/statistical/moments.h"

namespace candela::study {

using Image = std::vector<float>;

struct Truth {
  Truth(Image one, Image other);
  Image first, second;
  double mean = 0;
  double variance = 0;  // of one of them, relative to mean^2
};

struct Pattern {
  // Both of the same expectation.
  Pattern(const Truth& truth, Image one, const Image& other);
  Image biased;
  double square = 0;  // the squared bias, relative to mean^2
};

struct ImageErrors {
  statistical::Moments squared_error, variance, squared_bias, amplitude;  // over seeds
};
// error() of each is its standard error over seeds, from three seeds on. With one seed, variance and squared
// bias are not known and have no values; without a pattern, the amplitude has none.
ImageErrors errors_of(const std::vector<Image>& images, const Truth& truth);
ImageErrors errors_of(const std::vector<Image>& images, const Truth& truth, const Pattern& pattern);

// Mean of (I - R1)(I - R2) / (R^2 + 0.01 mean(R)^2), R = (R1 + R2) / 2: the noise of R1 and R2, which are
// independent, is not in the numerator's expectation.
double relative_squared_error(const Image& image, const Truth& truth);

// The mean of images [begin, end).
Image mean_image(const std::vector<Image>& images, std::size_t begin, std::size_t end);

}  // namespace candela::study
