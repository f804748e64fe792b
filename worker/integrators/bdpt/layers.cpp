#include "worker/integrators/bdpt/layers.h"

#include <fmt/format.h>

#include <algorithm>

#include "worker/integrators/regularise.h"

namespace candela::integrators::bdpt {

TechniqueLayers::TechniqueLayers(bool weighted, bool unweighted, std::uint32_t depth, std::uint32_t max_depth,
                                 bool lens) {
  const std::uint32_t own = std::min(depth, max_depth);
  if (weighted) weighted_ = make_table("weighted", own, own < max_depth, lens);
  if (unweighted) unweighted_ = make_table("unweighted", own, false, lens);
}

void TechniqueLayers::add_mollified() {
  names_.emplace_back(kMollifiedLayer);
  mollified_ = static_cast<std::uint32_t>(names_.size());
}

TechniqueLayers::Table TechniqueLayers::make_table(const std::string& kind, std::uint32_t depth, bool deeper,
                                                   bool lens) {
  Table table;
  table.layers.resize(depth);
  const auto add = [&](const std::string& name) {
    names_.push_back(fmt::format("{}.{}", kind, name));
    return static_cast<std::uint32_t>(names_.size());  // layer 0 is the image
  };
  for (std::uint32_t d = 1; d <= depth; ++d) {
    std::vector<std::uint32_t>& row = table.layers[d - 1];
    row.assign(d + 2, kNoLayer);
    // Light seen directly is found in one way alone.
    const std::uint32_t most = d == 1 ? 0 : lens ? d + 1 : d;
    for (std::uint32_t s = 0; s <= most; ++s) row[s] = add(fmt::format("s{}.t{}", s, d + 1 - s));
  }
  if (deeper) table.deeper = add("deeper");
  return table;
}

}  // namespace candela::integrators::bdpt
