#include "worker/integrators/mcppm/gather_places.h"

#include <span>

namespace candela::integrators::mcppm {

void GatherPlaces::build(const std::vector<Found>& tiles, std::vector<Vec3> Found::*places, float radius,
                         unsigned threads, transport::RangeSearch& search) {
  joined_.clear();
  for (const Found& tile : tiles) joined_.insert(joined_.end(), (tile.*places).begin(), (tile.*places).end());
  search.build(std::span<const Vec3>(joined_), radius, threads);
  search.forget_order();
}

}  // namespace candela::integrators::mcppm
