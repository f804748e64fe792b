// Statistics of trained light selection: for each cell of a grid over the scene and each light, how many
// points of the light were tested from there, and how many of them were seen. The rule `light_visibility`
// makes the state of an epoch from the counts of all epochs before that are whole: a byte for each entry, the
// weight of the light's share of the choice in the cell. If the counts of epoch 0 expect little of it, the
// states of all epochs after are empty: the choice stays untrained, and nothing is counted.
//
// Beyond kMaxLights lights, the light of an entry is a group of lights (scene::Lights).
//
// An entry has two integers, tested and seen, in a table of the job.
#pragma once

#include <cstdint>
#include <string_view>

#include "common/film/accumulator.h"

namespace candela::light_visibility {

inline constexpr std::string_view kRule = "light_visibility";  // and the name of the state
inline constexpr std::string_view kCounts = "light.visibility";
// Constants of the rule: entries in all, and in a cell.
inline constexpr std::string_view kEntries = "entries", kLights = "lights";

inline constexpr std::uint32_t kMaxSide = 16;  // cells along an axis
inline constexpr std::uint32_t kMaxLights = 64;
// A small film has few samples to train from: so many entries for each of its pixels.
inline constexpr std::uint32_t kMaxPerPixel = 16;

struct Layout {
  std::uint32_t side = 1;  // of the grid, in cells
  std::uint32_t lights = 0;

  // Entry of a light in a cell: cell * lights + light.
  std::uint32_t entries() const { return side * side * side * lights; }
};
// The finest grid for a film of this size; one cell if the film is very small.
Layout layout(std::uint32_t width, std::uint32_t height, std::uint32_t lights);

film::AccumulatorSpec spec(const Layout& layout);

// The weight of a light of which so many points were tested and seen. A choice in proportion to f sqrt(v) has
// the least variance where a point of value f is seen with probability v. v is estimated by
// (seen + 1) / (tested + 1); nothing tested: 255. Never below kMinWeight, so that no light is left out.
inline constexpr std::uint8_t kMaxWeight = 255, kMinWeight = 16;
std::uint8_t weight(std::uint64_t tested, std::uint64_t seen);

// Possible gain of trained selection, from the counts of an untrained epoch: there, tests of a cell are in
// proportion to f. In a cell of n tests the second moment of an estimate is in proportion to sum(seen) if the
// choice is by f, and to sum(tested weight)^2 / n, weights of at most 1, if it is by f sqrt(v).
class ExpectedGain {
 public:
  void add(std::uint64_t tested, std::uint64_t seen) {
    tested_ += static_cast<double>(tested);
    seen_ += static_cast<double>(seen);
    weighted_ += static_cast<double>(tested) * weight(tested, seen) / kMaxWeight;
  }
  void end_cell();
  // Enough tests to tell that trained selection takes less than kMinGain of the second moment away.
  bool too_small() const;

 private:
  double tested_ = 0, seen_ = 0, weighted_ = 0;          // of the cell
  double all_tested_ = 0, untrained_ = 0, trained_ = 0;  // of all cells
};
// Below it a trained choice costs more time than it saves noise.
inline constexpr double kMinGain = 0.04;
inline constexpr double kMinTests = 4096;

}  // namespace candela::light_visibility
