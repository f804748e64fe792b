#include "common/stages/epochs.h"

#include <algorithm>

#include "common/job/job.h"

namespace candela {

Epochs::Epochs(std::uint64_t first, std::uint32_t growth) : borders_{0} {
  while (borders_.back() < Limits::max_iterations) {
    const std::uint64_t length = std::max(first, borders_.back() / growth);
    borders_.push_back(borders_.back() + length + length % 2);
  }
}

std::uint64_t Epochs::begin(std::uint64_t epoch) const {
  return borders_[std::min<std::uint64_t>(epoch, borders_.size() - 1)];
}

std::uint64_t Epochs::of_iteration(std::uint64_t iteration) const {
  const auto after = std::upper_bound(borders_.begin(), borders_.end(), iteration);
  return static_cast<std::uint64_t>(after - borders_.begin()) - 1;
}

}  // namespace candela
