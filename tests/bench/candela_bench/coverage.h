// Tells if the error that a job shows covers the error that its image has: `candela-bench coverage`.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "tests/bench/candela_bench/coverage_cases.h"

namespace candela::bench {

struct CoverageOptions {
  std::string out;                               // folder of rendered halves, and of rows
  std::vector<std::string> scenes, integrators;  // names; empty: all
  std::uint64_t seeds = 1;                       // 1, 2, ... so many
  std::uint64_t last_spp = 1024;                 // 4, 8, ... to this
  std::uint64_t reference_spp = 0;               // 0: the scene's
  std::uint32_t side = 32;                       // pixels
  double cpu_minutes = 0;    // of rendering, after which only what is there counts; 0: no limit
  bool chosen_only = false;  // leave out the scenes that are held out
};

// One image beside the truth.
struct CoverageRow {
  std::string scene, integrator;
  bool held_out = false;
  std::uint64_t seed = 0, spp = 0;
  double truth = 0;  // its relMSE
  // Difference of the two halves of the reference: truth is known to a fraction of itself if this is small
  // beside it.
  double reference = 0;
  double relmse = 0, upper = 0, noise = 0, blur = 0;  // shown
  double by_own_image = 0;                            // the variance divided by the noisy image itself
  bool known() const { return truth > 0 && reference < truth; }
  bool covered() const { return truth <= upper; }
};

// Rows of the points of one job; `reference` as a pair of independent images, or one exact one twice.
std::vector<CoverageRow> coverage_rows(const CoverageScene& scene, const std::string& integrator,
                                       std::uint64_t seed, const std::vector<CoveragePoint>& points,
                                       const std::vector<float>& reference_a,
                                       const std::vector<float>& reference_b);

// By integrator: how many images were looked at, how many of them are covered, and the medians of what is
// shown over the truth. Markdown.
std::string coverage_table(const std::vector<CoverageRow>& rows);

// Renders what is missing in the folder, writes rows.csv there, and returns the tables.
Result<std::string> coverage(const CoverageOptions& options, const std::atomic<bool>& stop,
                             const std::function<void(const std::string&)>& say);

}  // namespace candela::bench
