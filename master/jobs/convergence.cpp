#include "master/jobs/convergence.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <system_error>

namespace candela::master {
namespace {

// Estimates of a job are 10 % of its iterations apart: 2^40 iterations are 290 lines.
constexpr std::uintmax_t kMaxFileBytes = 1 << 20;

std::filesystem::path file_in(const std::filesystem::path& job_folder) {
  return job_folder / "convergence.txt";
}

}  // namespace

void append_convergence(const std::filesystem::path& job_folder, const ConvergencePoint& point) {
  if (!std::isfinite(point.relmse) || point.relmse <= 0) return;
  std::error_code error;
  std::filesystem::create_directories(job_folder, error);
  const std::uintmax_t size = std::filesystem::file_size(file_in(job_folder), error);
  if (!error && size > kMaxFileBytes) return;
  std::ofstream out(file_in(job_folder), std::ios::app);
  // All digits: a master that starts again shows this upper end.
  out << fmt::format("{} {:.3f} {} {}\n", point.iterations, point.elapsed_seconds, point.relmse,
                     point.relmse_upper);
}

std::vector<ConvergencePoint> read_convergence(const std::filesystem::path& job_folder) {
  std::vector<ConvergencePoint> points;
  std::ifstream in(file_in(job_folder));
  for (std::string line; std::getline(in, line);) {
    if (in.eof()) break;  // without its end of line: cut, or being written
    ConvergencePoint p;
    std::istringstream fields(line);
    if (!(fields >> p.iterations >> p.elapsed_seconds >> p.relmse) || !std::isfinite(p.relmse)) continue;
    // By strtod, which knows "nan" and "inf".
    if (std::string upper; fields >> upper) p.relmse_upper = std::strtod(upper.c_str(), nullptr);
    while (!points.empty() && points.back().iterations >= p.iterations) points.pop_back();
    points.push_back(p);
  }
  return points;
}

}  // namespace candela::master
