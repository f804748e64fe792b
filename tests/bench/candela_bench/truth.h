// References made by the program itself: by two integrators, which must agree.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "tests/bench/candela_bench/estimator.h"
#include "tests/bench/candela_bench/spec.h"

namespace candela::bench {

struct TruthOptions {
  std::string scene_file;
  std::uint32_t width = 0, height = 0;
  std::vector<std::string> integrators;  // two of them
  std::vector<std::string> sets;
  std::uint64_t iterations = 0;  // of each integrator, in all its batches
  std::uint64_t batches = 16;    // independent runs of each, from whose spread the error is known
  unsigned threads = 1;
  std::uint32_t block = 16;  // pixels a side of the blocks that are compared
  std::string out;           // NAME.exr
};

// Renders the batches (those in NAME.parts are there already), compares the two integrators block by block in
// two stages (tests/statistical/block_tests.h: at most 1e-5 for a false alarm), and writes NAME.exr and
// NAME.stderr.exr: the mean weighted by inverse variance, one weight for the whole image, since weights that
// follow a pixel's own samples would be biased. Refused, and nothing written, where they disagree. Returns
// what there is to say, a few lines.
Result<std::string> make_truth(const TruthOptions& options, const EstimatorFactory& factory,
                               const std::atomic<bool>& stop,
                               const std::function<void(const std::string&)>& say);

}  // namespace candela::bench
