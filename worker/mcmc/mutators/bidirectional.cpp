#include "worker/mcmc/mutators/bidirectional.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "worker/core/math.h"

namespace candela::mcmc {

using transport::path::Kind;
using transport::path::PathVertex;

namespace {

constexpr std::size_t kMaxDeleted = 16, kMaxDifference = 8;

// p_d by the number of vertices: as [Veach 1997, Sec. 11.4.2.1] by edges, of which there is one more.
double weight_of_deletion(std::size_t vertices) {
  return vertices == 0 ? 0.25 : vertices == 1 ? 0.5 : std::ldexp(1.0, -static_cast<int>(vertices) - 1);
}
// p_a by the difference of numbers, which either way has the same weight.
double weight_of_addition(std::size_t difference) {
  return difference == 0   ? 0.5
         : difference == 1 ? 0.15
                           : 0.2 * std::ldexp(1.0, -static_cast<int>(difference));
}

}  // namespace

bool BidirectionalMutator::can_add(const Subpaths::Kept& kept, std::size_t deleted, std::size_t a) const {
  const std::size_t vertices = kept.light + kept.eye + a;
  if (vertices < std::size_t{context_.min_edges} + 1 || vertices > std::size_t{context_.max_edges} + 1)
    return false;
  // The same path: nothing changes, or a pinhole takes its own place.
  const bool pinhole_alone = kept.eye == 0 && deleted == 1 && !context_.scene.reads_lens();
  if (a == deleted && (deleted == 0 || pinhole_alone)) return false;
  return subpaths_.choices(kept, a).count > 0;
}

template <class Visit>
void BidirectionalMutator::for_each_addition(const Subpaths::Kept& kept, std::size_t deleted,
                                             const Visit& visit) const {
  const std::size_t least = deleted > kMaxDifference ? deleted - kMaxDifference : 0;
  for (std::size_t a = least; a <= deleted + kMaxDifference; ++a)
    if (can_add(kept, deleted, a)) visit(a, weight_of_addition(a > deleted ? a - deleted : deleted - a));
}

bool BidirectionalMutator::any_addition(const Subpaths::Kept& kept, std::size_t deleted) const {
  const std::size_t least = deleted > kMaxDifference ? deleted - kMaxDifference : 0;
  for (std::size_t a = least; a <= deleted + kMaxDifference; ++a)
    if (can_add(kept, deleted, a)) return true;
  return false;
}

// All that may be taken away of a path.
struct BidirectionalMutator::Ranges final : Memo {
  std::vector<Range> all;
  double sum = 0;
};

// visit(kept, number of deleted vertices) of each range, until it returns true. True: it did.
template <class Visit>
bool BidirectionalMutator::any_range(const transport::path::Path& path, const Visit& visit) const {
  const std::vector<PathVertex>& v = path.vertices;
  const std::size_t count = v.size();
  for (std::size_t light = 0; light < count; ++light) {
    if (light > 0 && (v[light - 1].delta || v[light - 1].mollified)) continue;
    // x_m, the first vertex that is kept behind, is never the light; count: none is kept.
    for (std::size_t m = std::max<std::size_t>(light, 1); m <= std::min(count, light + kMaxDeleted); ++m) {
      if (m < count && (v[m].delta || v[m].mollified)) continue;
      const Subpaths::Kept kept{light, count - m};
      if (any_addition(kept, m - light) && visit(kept, m - light)) return true;
    }
  }
  return false;
}

const BidirectionalMutator::Ranges& BidirectionalMutator::ranges(const PathState& from) const {
  return from.memo<Ranges>(this, [&] {
    auto made = std::make_unique<Ranges>();
    made->all.reserve(16);
    any_range(from.path, [&](const Subpaths::Kept& kept, std::size_t deleted) {
      made->all.push_back({kept, weight_of_deletion(deleted)});
      made->sum += made->all.back().weight;
      return false;
    });
    return made;
  });
}

// Most states are proposals of other mutations, whose ranges nobody asks for.
double BidirectionalMutator::suitability(const PathState& from) const {
  const std::vector<PathVertex>& v = from.path.vertices;
  const auto stays = [&](std::size_t i) { return !v[i].delta && !v[i].mollified; };
  // An inner vertex of a usual path, with another one beside it, can be made anew.
  if (const std::size_t k = v.size() - 1; k >= 3 && k >= context_.min_edges && k <= context_.max_edges)
    for (std::size_t i = 1; i < k; ++i)
      if (stays(i - 1) && stays(i + 1)) return 1;
  return any_range(from.path, [](const Subpaths::Kept&, std::size_t) { return true; }) ? 1 : 0;
}

Proposal BidirectionalMutator::propose(const PathState& from, rng::Stream& stream) const {
  const Ranges& all = ranges(from);
  double u = stream.next_double() * all.sum;
  const Range* chosen = &all.all.back();
  for (const Range& range : all.all) {
    u -= range.weight;
    if (u < 0) {
      chosen = &range;
      break;
    }
  }
  const Subpaths::Kept kept = chosen->kept;
  const std::size_t deleted = from.path.vertices.size() - kept.light - kept.eye;
  double additions = 0;
  for_each_addition(kept, deleted, [&](std::size_t, double weight) { additions += weight; });
  u = stream.next_double() * additions;
  std::size_t added = 0;
  for_each_addition(kept, deleted, [&](std::size_t a, double weight) {
    if (u >= 0) added = a;
    u -= weight;
  });
  const Subpaths::Choices choices = subpaths_.choices(kept, added);
  const auto choice = static_cast<std::size_t>(stream.next_double() * static_cast<double>(choices.count));
  Proposal made =
      subpaths_.make(&from, kept, added, choices.first + std::min(choice, choices.count - 1), stream);
  if (made && *made == from.path) return MutationFailure::no_path;  // a lamp in its own place
  return made;
}

std::optional<double> BidirectionalMutator::log_pdf_area(const PathState& from, const PathState& to) const {
  const auto changed = transport::path::changed_range(from.path, to.path);
  const std::size_t count = from.path.vertices.size(), to_count = to.path.vertices.size();
  const std::size_t front = changed.begin, back = count - changed.end;
  // A vertex that is equal was kept, for to make it again has no probability: but an end of which there is
  // one.
  const PathVertex& light = from.path.vertices.front();
  const bool one_light = light.kind == Kind::point_light || light.kind == Kind::directed_light;
  const bool one_sensor = !context_.scene.reads_lens();
  const auto keeps = [&](const Subpaths::Kept& kept) {
    return (kept.light == front || (kept.light == 0 && front == 1 && one_light)) &&
           (kept.eye == back || (kept.eye == 0 && back == 1 && one_sensor));
  };
  const Ranges& all = ranges(from);
  LogSum sum;
  for (const Range& range : all.all) {
    if (!keeps(range.kept)) continue;
    const std::size_t deleted = count - range.kept.light - range.kept.eye;
    const std::size_t added = to_count - range.kept.light - range.kept.eye;
    double additions = 0, chosen = 0;
    for_each_addition(range.kept, deleted, [&](std::size_t a, double weight) {
      additions += weight;
      if (a == added) chosen = weight;
    });
    if (!(chosen > 0)) continue;
    const auto density = subpaths_.log_pdf_area(to, range.kept);
    if (density) sum.add(*density + math::log(range.weight / all.sum * (chosen / additions)));
  }
  return sum.value();
}

}  // namespace candela::mcmc
