// Renders a job of Markov chains in this process, as the farm would: bootstrap, starts, segments, the
// combined image.
#pragma once

#include <cstdint>
#include <vector>

#include "common/chains/chains.h"
#include "tests/statistical/harness.h"

namespace candela::statistical {

struct ChainJob {
  TestScene scene;
  std::uint64_t rounds = 1;  // segments of each chain
  unsigned threads = 1;
  double b0_factor = 1;  // wrong on purpose
};

struct ChainImage {
  std::uint32_t width = 0, height = 0;
  std::vector<double> image;           // width * height * 3
  std::vector<double> chains, others;  // the same of the two layers, before they are combined
  chains::Normalisation b0, b;         // bootstrap's (not falsified), pooled
  ChainPlan plan;
  NamedState state;                                                       // that the segments started from
  std::vector<chains::ChainRecord> records;                               // in the order of chains
  film::SampleCounts sample_counts;                                       // of bootstrap and segments
  std::vector<std::int64_t> sums;                                         // of the film
  double pilot_seconds = 0, bootstrap_seconds = 0, segments_seconds = 0;  // CPU, all threads
};

// A refusal or an error throws.
ChainImage render_chains(const ChainJob& job, std::uint64_t seed);
// Batches of independent jobs for block tests, of `rounds` times effort rounds each. A rejected sample
// throws.
Estimator make_chain_estimator(const std::string& name, const ChainJob& job, std::uint64_t seed,
                               std::size_t batches, const Regions& regions);

}  // namespace candela::statistical
