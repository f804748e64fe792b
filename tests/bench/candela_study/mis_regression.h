// Estimators by regression, for comparison.
//
// Owen and Zhou's estimator of an integral from samples of several techniques [Owen 2000], as [Kondapaneni
// 2019, supplement, Eq. S3 to S6] writes it: f / p_c is regressed on an intercept and all p_k / p_c, and the
// coefficients are added up. The columns are dependent, so that the least one of all solutions is taken, by a
// singular value decomposition. Apart from rounding this is the direct estimator without a ridge.
//
// [Fan 2006] as [Kondapaneni 2019, supplement, Algorithm 3] has it: one batch of few samples, a technique's
// column left out, the intercept in the ridge. Inconsistent.
#pragma once

#include <span>
#include <vector>

#include "tests/bench/candela_study/mis_case.h"

namespace candela::study {

// The shortest x of least |D x - y|; `columns` are those of D. One-sided Jacobi rotations; singular values
// below 1e-9 of the largest count as zero.
std::vector<double> least_squares(std::vector<std::vector<double>> columns, const std::vector<double>& y);

// From all samples of a number of batches.
double owen_zhou(const mis::Allocation& allocation, std::span<const MisSample> samples);

// Fan et al.'s, from one batch, by the system without column `dropped` (0: the intercept, i + 1: technique
// i).
double fan(const mis::Allocation& allocation, const mis::Sums& batch, std::size_t dropped);

}  // namespace candela::study
