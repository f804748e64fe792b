#include "worker/integrators/upbp/work_counts.h"

#include "worker/core/math.h"
#include "worker/transport/box_tree.h"
#include "worker/transport/technique/merge_medium.h"

namespace candela::integrators::upbp {
namespace {

// Nanoseconds: docs/lab/upbp-tests.md says which are fitted to CPU times and which are set.
constexpr double kOfRay = 335, kOfQuery = 30, kOfNode = 20, kOfMerge = 175, kOfItem = 150, kOfSearched = 100;
constexpr double kPointsOfNode = transport::BoxTree::kWide;

}  // namespace

void WorkCounts::add(const transport::MergeWork& work) {
  const auto& [asked, looked_into, weighted] = work;
  queries += asked.point_point + asked.point_beam + asked.beam_point + asked.beam_beam;
  point_nodes += looked_into.point_point + looked_into.point_beam;
  beam_nodes += looked_into.beam_point + looked_into.beam_beam;
  point_merges += weighted.point_point + weighted.point_beam;
  beam_merges += weighted.beam_point + weighted.beam_beam;
}

double WorkCounts::cost(double density) const {
  const auto of_points = [&](std::uint64_t n) { return density * static_cast<double>(n); };
  const double closer = math::pow(density, 1.0 / 3);
  const double nodes = closer * static_cast<double>(point_nodes) +
                       (density - closer) * static_cast<double>(point_merges) / kPointsOfNode;
  return kOfRay * static_cast<double>(rays) + kOfQuery * static_cast<double>(queries) +
         kOfNode * (nodes + static_cast<double>(beam_nodes)) +
         kOfMerge * (of_points(point_merges) + static_cast<double>(beam_merges)) +
         kOfSearched * static_cast<double>(searched) +
         kOfItem * (static_cast<double>(points) + static_cast<double>(pieces) / density);
}

}  // namespace candela::integrators::upbp
