// Movement of an image as its iterations grow: the bias of merging is known by it.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

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

// Two sums over the iterations of a job, one of them weighted by how large the bias of merging is at each:
// i^(alpha - 1) at iteration i, as squared radii are. Iterations are weighted in groups, each twice the one
// before, so that an image a group is enough.
class Movement {
 public:
  // The image has twice the iterations of the last group, or is the first.
  bool due(double n0, double n1) const;
  // Adds what was merged since the last call as one group. No effect unless it is due. Images of another size
  // begin anew. Precondition: `now` has all iterations that the calls before had, and some of either half.
  void add(const BlockMeans& now, double alpha);

  // The regression of the image on the weights: for each value of `now` the bias that it has, by half. Empty
  // unless there are two groups at least, the last with what was merged since.
  struct Bias {
    std::vector<float> a, b;
  };
  Bias bias(const BlockMeans& now, double alpha) const;

  std::string serialise() const;
  // Fails (input) on anything but the whole of what serialise() made.
  static Result<Movement> parse(std::string_view bytes);

 private:
  bool fits(const BlockMeans& now) const;
  // The last group as it would be.
  struct Half {
    double g = 0, gg = 0;         // sums over groups of iterations * weight, and * weight^2
    std::vector<float> weighted;  // sums of iterations * weight * mean
  };
  static void extend(Half& half, double from, double to, double weight, const std::vector<float>& before,
                     const std::vector<float>& now);

  BlockMeans last_;  // after the last group
  Half half_[2];
};

}  // namespace candela::stats
