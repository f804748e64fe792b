#include "common/stages/light_visibility.h"

#include <algorithm>
#include <string>

namespace candela::light_visibility {

Layout layout(std::uint32_t width, std::uint32_t height, std::uint32_t lights) {
  const std::uint64_t pixels = std::uint64_t{width} * height;
  const auto entries = [&](std::uint64_t side) { return side * side * side * lights; };
  Layout out{kMaxSide, lights};
  while (out.side > 1 && entries(out.side) > pixels * kMaxPerPixel) --out.side;
  return out;
}

film::AccumulatorSpec spec(const Layout& layout) {
  using Spec = film::AccumulatorSpec;
  return {std::string(kCounts), 2, 0, Spec::Per::epoch, Spec::Domain::table, layout.entries()};
}

std::uint8_t weight(std::uint64_t tested, std::uint64_t seen) {
  // Integers alone: the largest w with w^2 (tested + 1) <= 255^2 (seen + 1). Counts are below 2^40.
  constexpr std::uint64_t kSquare = std::uint64_t{kMaxWeight} * kMaxWeight;
  const std::uint64_t all = tested + 1, some = std::min(seen, tested) + 1;
  std::uint64_t low = 0, high = kMaxWeight;
  while (low < high) {
    const std::uint64_t middle = (low + high + 1) / 2;
    if (middle * middle * all <= kSquare * some)
      low = middle;
    else
      high = middle - 1;
  }
  return static_cast<std::uint8_t>(std::max<std::uint64_t>(low, kMinWeight));
}

void ExpectedGain::end_cell() {
  all_tested_ += tested_;
  untrained_ += seen_;
  if (tested_ > 0) trained_ += weighted_ * weighted_ / tested_;
  tested_ = seen_ = weighted_ = 0;
}
bool ExpectedGain::too_small() const {
  return all_tested_ >= kMinTests && untrained_ - trained_ < kMinGain * untrained_;
}

}  // namespace candela::light_visibility
