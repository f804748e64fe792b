// The choice among sets of techniques by trials: the least product of error and work.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace candela::transport {
struct MergeWork;
}

namespace candela::integrators::upbp {

inline constexpr std::size_t kReplicates = 3;

// Work of rendering, in counts that are the same on every machine.
struct WorkCounts {
  std::uint64_t rays = 0;
  std::uint64_t queries = 0;
  std::uint64_t point_nodes = 0, beam_nodes = 0;       // of trees that queries looked into
  std::uint64_t point_merges = 0, beam_merges = 0;     // pairs that were weighted
  std::uint64_t searched = 0, points = 0, pieces = 0;  // that searches, and trees, were built of

  // In nanoseconds of one core, about, of a film of as many pixels whose iteration has `density` times as
  // many light paths: a query meets so many times as many points, and each pixel pays for that share of the
  // beams, of which an iteration has the same number. Nodes of points become smaller: a query beam crosses
  // more of them as the cube root of the density, and those whose points it meets grow as the merges.
  double cost(double density) const;

  // The queries, nodes and merges of an iteration.
  void add(const transport::MergeWork& work);
};

struct Trial {
  // Values are means over squares of pixels: see means_of_squares(). Replicate r of all trials has the same
  // random numbers; replicates are independent.
  std::vector<float> images[kReplicates];
  double cost = 0;
};

// The means of an image of three channels over squares of kSquare pixels a side, or less, so that the shorter
// side of the image has kLeastSquares of them if it has as many pixels. At the right and below they may be
// smaller.
inline constexpr std::uint32_t kSquare = 8, kLeastSquares = 4;
std::vector<float> means_of_squares(std::span<const float> image, std::uint32_t width, std::uint32_t height);

// The squared error of one image of each trial, over the square of the truth and a hundredth of its mean's.
// The truth is that of all trials together, each weighted by the inverse of its error, so that a trial which
// misses light that others find has that as its error. For replicate r it is taken from the two others, one
// in each factor of the square: their noise is not in the expectation.
std::vector<double> trial_errors(std::span<const Trial> trials);

struct Choice {
  std::size_t index = 0;
  std::vector<double> inefficiency;  // of each trial: error times cost, over the least
  std::vector<double> cost;          // of each, over that of the first
};
// A trial is cheap if it costs at most kCheap times the first.
inline constexpr double kCheap = 1.5;
// Cheap trials within kAlike times the lowest inefficiency count as equal.
inline constexpr double kAlike = 1.05;
// The trial of lowest inefficiency, or the last of those that count as equal: a small pilot does not see all
// that further techniques gain if light is rare. Precondition: each trial has all techniques of those before.
Choice choose(std::span<const Trial> trials);
// True if the last trial, which has the techniques of trial `chosen`, has less error times cost.
bool last_is_better(std::span<const Trial> trials, std::size_t chosen);

}  // namespace candela::integrators::upbp
