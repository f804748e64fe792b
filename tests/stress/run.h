// Runs points of sweeps: renders independent batches, counts what is rejected, judges.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "common/film/film.h"
#include "tests/stress/sweep.h"
#include "tests/stress/verdict.h"

namespace candela::stress {

struct Point {
  std::string sweep, integrator;
  double value = 0;
  Verdict verdict = Verdict::undecided;
  // The quantity that decided, or came nearest to its tolerance, and its figures.
  std::string quantity;
  double measured = 0, expected = 0, deviation = 0, stderr_of_deviation = 0, tolerance = 0;
  film::SampleCounts sample_counts;  // of all batches of all stages
  std::uint64_t iterations = 0;      // a batch, in the last stage
  double seconds = 0;                // CPU
  std::string refusal;               // why nothing could be rendered
  std::uint64_t rejected() const;
};

struct RunOptions {
  std::uint64_t seed = 1;
  std::size_t batches = 32;
  int stages = 6;            // each of four times the samples, until a point is decided
  double most_rays = 1.6e7;  // an undecided point's next stage is not begun if it would trace more
  unsigned threads = 2;
  // Spoils samples on their way into the film, to see that the machinery notices. Not for chains.
  void (*fault)(std::uint64_t sample_key, float* rgb) = nullptr;
};

// Runs points of one sweep through one integrator; keeps the benign end's batches, with which others compare.
class Runner {
 public:
  Runner(const Sweep& sweep, const Claim& claim, const RunOptions& options)
      : sweep_(sweep), claim_(claim), options_(options) {}
  Point run(double value);

 private:
  struct Stage {
    std::vector<std::vector<double>> rows;  // [batch][quantity]
    film::SampleCounts sample_counts;
  };
  Stage render(double value, int stage, std::uint64_t iterations) const;
  // Tells the probe what the verdict depends on beside films.
  void note(const Shot& shot) const;

  const Sweep& sweep_;
  const Claim& claim_;
  RunOptions options_;
  std::map<int, Stage> baseline_;  // by stage
};

// The claim of an integrator; null where it makes none.
const Claim* find_claim(const Sweep& sweep, const std::string& integrator);
// Shot at a value; if the sweep names no quantities, the image and its quarters.
Shot complete_shot(const Sweep& sweep, double value);

}  // namespace candela::stress
