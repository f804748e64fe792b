// The error estimates of a job over time: jobs/ID/convergence.txt, for the plot of the page.
//
// A line is "iterations seconds relmse upper"; lines of older masters lack the last. The file is a record for
// people, no part of the truth: a write that fails is passed over, and a line that was cut by a crash is not
// read.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <vector>

namespace candela::master {

struct ConvergencePoint {
  std::uint64_t iterations = 0;
  double elapsed_seconds = 0;
  double relmse = 0;
  double relmse_upper = std::numeric_limits<double>::quiet_NaN();  // of the estimate's interval
};

// No effect unless the estimate is positive and finite.
void append_convergence(const std::filesystem::path& job_folder, const ConvergencePoint& point);
// In order of iterations. A job that lost iterations and renders them again has the newer points.
std::vector<ConvergencePoint> read_convergence(const std::filesystem::path& job_folder);

}  // namespace candela::master
