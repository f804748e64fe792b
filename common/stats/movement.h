// Movement of an image as its iterations grow: the bias of merging is known by it.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

namespace candela::stats {

// Means of an image's halves over blocks of pixels.
struct BlockMeans {
  std::uint32_t side = 1;               // of a block, pixels; those at the right and lower border may be cut
  std::uint32_t width = 0, height = 0;  // blocks
  double n0 = 0, n1 = 0;                // iterations of each half
  std::vector<float> a, b;              // width * height * 3
};
// Blocks a side, at most: an image up to this size is seen pixel by pixel.
inline constexpr std::uint32_t kMaxBlocks = 256;
// Pixels a side of a block of an image.
constexpr std::uint32_t block_side(std::uint32_t width, std::uint32_t height) {
  return (std::max(width, height) + kMaxBlocks - 1) / kMaxBlocks;
}

// The mean of i^(alpha - 1) over the iterations (from, to].
double mean_movement_weight(double from, double to, double alpha);

// Sums over the iterations of a job, weighted by how large the bias of merging is at each: x = i^(alpha - 1)
// at iteration i. Iterations are weighted in groups, each twice the one before, so that an image a group is
// enough.
//
// The bias is the slope of the iterations' images over x, by weighted least squares. Where photons alone make
// the image, x goes as the radius and an iteration's noise as 1 / radius^2, so its weight is x^2. Where they
// make a part, the slope is without bias too.
class Movement {
 public:
  // The image has twice the iterations of the last group, or is the first.
  bool due(double n0, double n1) const;
  // Adds what was merged since the last call as one group. No effect unless it is due. Images of another size
  // begin anew. Precondition: `now` has all iterations that the calls before had, and some of either half.
  void add(const BlockMeans& now, double alpha);

  // For each value of `now` the bias that it has, by half. Empty unless there are two groups at least, the
  // last with what was merged since.
  struct Bias {
    std::vector<float> a, b;
  };
  Bias bias(const BlockMeans& now, double alpha) const;

  struct Half {
    std::array<double, 4> powers = {};  // sums over iterations of x, x^2, x^3, x^4
    std::vector<float> squares, cubes;  // sums over iterations of x^2 * image, and of x^3 * image
  };
  // From the sums of all groups. `last`: size and iterations of the image; its means are not read.
  static Movement of(BlockMeans last, std::array<Half, 2> sums);

 private:
  bool fits(const BlockMeans& now) const;
  // Adds the last group as it would be.
  static void extend(Half& half, double from, double to, double x, const std::vector<float>& before,
                     const std::vector<float>& now);

  BlockMeans last_;  // after the last group
  std::array<Half, 2> half_;
};

}  // namespace candela::stats
