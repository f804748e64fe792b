// Errors of images: against a reference, and estimated from two independent halves.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "common/film/development.h"
#include "common/film/merged_film.h"

namespace candela::stats {

// Figures of image a against reference b (same size, interleaved RGB). Sums in double, in pixel order.
struct ImageComparison {
  double mean_a = 0, mean_b = 0, mean_ratio = 0;  // over all pixels and channels; ratio NaN if mean_b is 0
  double rmse = 0;
  double relmse = 0;          // mean((a-b)^2 / (b^2 + 0.01 mean(b)^2))
  double relmse_trimmed = 0;  // without the worst 0.1 % of pixels
  struct Pixel {
    std::uint32_t x, y;
    double relative_squared_error;  // mean over the channels of the relMSE terms
    std::array<float, 3> a, b;
  };
  std::vector<Pixel> worst;  // worst first
};
// Precondition: a.size() == b.size() == width * height * 3. Non-finite pixels count as infinitely wrong.
ImageComparison compare(std::span<const float> a, std::span<const float> b, std::uint32_t width,
                        std::uint32_t height, std::size_t worst_count = 10);

// Keeps the relative error of dark pixels finite: relMSE = (a-b)^2 / (b^2 + 0.01 mean^2).
inline constexpr double kDarkFraction = 0.01;
// 1 / (reference^2 + 0.01 mean^2): what a squared error is weighed by in relMSE, `mean` the whole
// reference's. 0 where the reference is black all over.
double relative_weight(double reference, double mean);

// Error of the pooled image of a film with halves of n0 and n1 iterations, means A and B: per value the
// variance of the pooled mean M is estimated without bias by (A-B)^2 n0 n1 / (n0+n1)^2, and relMSE =
// mean(variance / (M^2 + 0.01 mean(M)^2)). NaN unless both halves have iterations; 0 for a black film.
// With a development that has a factor: of the image as developed, where the factor's own variance adds
// (relative variance * (what carries the factor)^2) to each value's. For a job of chains the halves are
// independent groups of chains, so that the correlation within a chain needs no model: A and B differ by all
// of it. Where their halves are unequal, that correlation decides how the variance of one half follows from
// the other's, and (A-B)^2 is weighed by (n0^2 + n1^2) / 2 (n0+n1)^2 instead: without bias if chains repeat
// themselves wholly, too large by (n0-n1)^2 / 2 n0 n1 of the variance if they forget all at once
// (docs/normalisation.md).
struct ErrorEstimate {
  double relmse = 0;
  double rmse = 0;
  double mean = 0;
};
ErrorEstimate estimate_error(const film::MergedFilm& film, const film::Development& development = {});
// The standard deviation of each value of the pooled image estimated as above (one degree of freedom: noisy;
// smooth before display). width * height * 3.
std::vector<float> error_map(const film::MergedFilm& film, const film::Development& development = {});
// Its square, the variance of each value, which is estimated without bias: means of it over pixels or images
// estimate the mean of the variance, which means of error_map() do not.
std::vector<float> variance_map(const film::MergedFilm& film, const film::Development& development = {});

}  // namespace candela::stats
