// The choice among variants of an integrator by trials: the least product of error and work.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace candela::integrators::pilot {

inline constexpr std::size_t kReplicates = 3;

struct Trial {
  // Values are means over squares of pixels: see means_of_squares(). Replicate r of all trials has the same
  // random numbers; replicates are independent.
  std::vector<float> images[kReplicates];
  double cost = 0;
};

// The means of an image of three channels over squares of kSquare pixels a side, or less, so that the shorter
// side of the image has kMinSquares of them if it has as many pixels. At the right and below they may be
// smaller.
inline constexpr std::uint32_t kSquare = 8, kMinSquares = 4;
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

}  // namespace candela::integrators::pilot
