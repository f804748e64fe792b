#include "worker/integrators/upbp/hits.h"

#include "worker/transport/radius.h"

namespace candela::integrators::upbp {
namespace {

// The volume of the kernel of a kind of merge over that of the first iteration.
double shrunken(std::uint64_t iteration, int dimension) {
  const double radius = transport::blur_radius(1, iteration, dimension);
  return dimension == 1 ? radius : dimension == 2 ? radius * radius : radius * radius * radius;
}

using Numbers = transport::ByMerge<double>;
struct Kind {
  double Numbers::*hits;
  double transport::MediumMerges::*eta;
  int dimension;
};
constexpr Kind kKinds[] = {{&Numbers::point_point, &transport::MediumMerges::point_point, 3},
                           {&Numbers::point_beam, &transport::MediumMerges::point_beam, 2},
                           {&Numbers::beam_point, &transport::MediumMerges::beam_point, 2},
                           {&Numbers::beam_beam, &transport::MediumMerges::beam_beam, 1}};

Numbers numbers(const transport::ByMerge<std::uint64_t>& counts) {
  return {static_cast<double>(counts.point_point), static_cast<double>(counts.point_beam),
          static_cast<double>(counts.beam_point), static_cast<double>(counts.beam_beam)};
}

}  // namespace

ExpectedHits ExpectedHits::scaled(double paths, double beam_paths) const {
  return {{point_point * paths, point_beam * paths, beam_point * beam_paths, beam_beam * beam_paths}};
}

ExpectedHits ExpectedHits::in(std::uint64_t iteration) const {
  ExpectedHits hits = *this;
  for (const Kind& kind : kKinds) hits.*kind.hits *= shrunken(iteration, kind.dimension);
  return hits;
}

void ExpectedHits::divide(transport::MediumMerges& eta) const {
  for (const Kind& kind : kKinds) eta.*kind.eta /= 1 + this->*kind.hits;
}

void HitCounts::add(const transport::MergeWork& work, std::uint64_t iteration) {
  const Numbers merges = numbers(work.merges), queries = numbers(work.queries);
  for (const Kind& kind : kKinds) {
    merges_.*kind.hits += merges.*kind.hits;
    queries_.*kind.hits += queries.*kind.hits * shrunken(iteration, kind.dimension);
  }
}

ExpectedHits HitCounts::expected() const {
  ExpectedHits expected;
  for (const Kind& kind : kKinds)
    if (queries_.*kind.hits > 0) expected.*kind.hits = merges_.*kind.hits / queries_.*kind.hits;
  return expected;
}

}  // namespace candela::integrators::upbp
