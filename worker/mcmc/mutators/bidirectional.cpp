#include "worker/mcmc/mutators/bidirectional.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "worker/core/math.h"

namespace candela::mcmc {

using transport::path::Kind;
using transport::path::PathVertex;

namespace {

constexpr std::size_t kMaxDeleted = 16, kMaxDifference = 8;

constexpr double halved(double value, std::size_t times) {
  return times == 0 ? value : 0.5 * halved(value, times - 1);
}

// p_d by the number of vertices: as [Veach 1997, Sec. 11.4.2.1] by edges, of which there is one more.
constexpr auto kWeightsOfDeletion = [] {
  std::array<double, kMaxDeleted + 1> weights{0.25, 0.5};
  for (std::size_t d = 2; d < weights.size(); ++d) weights[d] = halved(1, d + 1);
  return weights;
}();
// p_a by the difference of numbers, which either way has the same weight.
constexpr auto kWeightsOfAddition = [] {
  std::array<double, kMaxDifference + 1> weights{0.5, 0.15};
  for (std::size_t d = 2; d < weights.size(); ++d) weights[d] = halved(0.2, d);
  return weights;
}();

bool can_end_kept(const PathVertex& v) {
  return !v.delta && !v.mollified;
}

// True if both walks go on from what is kept: any number of vertices may come between them.
bool goes_on(const Subpaths::Kept& kept) {
  return kept.light > 1 && kept.eye > 1;
}

}  // namespace

// The bounds of numbers of vertices that may take the place of `deleted` ones.
BidirectionalMutator::Bounds BidirectionalMutator::bounds(const Subpaths::Kept& kept,
                                                          std::size_t deleted) const {
  const std::size_t ends = kept.light + kept.eye, least = std::size_t{context_.min_edges} + 1,
                    most = std::size_t{context_.max_edges} + 1;
  if (ends > most) return {};
  return {std::max(deleted > kMaxDifference ? deleted - kMaxDifference : 0, least > ends ? least - ends : 0),
          std::min(deleted + kMaxDifference, most - ends) + 1};
}

inline bool BidirectionalMutator::can_add(const Subpaths::Kept& kept, std::size_t deleted,
                                          std::size_t a) const {
  // The same path: nothing changes, or a pinhole takes its own place.
  const bool pinhole_alone = kept.eye == 0 && deleted == 1 && !context_.scene.reads_lens();
  if (a == deleted && (deleted == 0 || pinhole_alone)) return false;
  return subpaths_.choices(kept, a).count > 0;
}

template <class Visit>
void BidirectionalMutator::for_each_addition(const Subpaths::Kept& kept, std::size_t deleted,
                                             const Visit& visit) const {
  const Bounds all = bounds(kept, deleted);
  const bool any = goes_on(kept) && deleted > 0;
  for (std::size_t a = all.begin; a < all.end; ++a)
    if (any || can_add(kept, deleted, a))
      visit(a, kWeightsOfAddition[a > deleted ? a - deleted : deleted - a]);
}

bool BidirectionalMutator::any_addition(const Subpaths::Kept& kept, std::size_t deleted) const {
  const Bounds all = bounds(kept, deleted);
  for (std::size_t a = all.begin; a < all.end; ++a)
    if (can_add(kept, deleted, a)) return true;
  return false;
}

// visit(kept, number of deleted vertices) of each range, until it returns true. True: it did.
template <class Visit>
bool BidirectionalMutator::any_range(const transport::path::Path& path, const Visit& visit) const {
  const std::vector<PathVertex>& v = path.vertices;
  const std::size_t count = v.size();
  // True if as many vertices may come as are taken away, for sure where both walks go on.
  const bool fits = count > std::size_t{context_.min_edges} && count <= std::size_t{context_.max_edges} + 1;
  for (std::size_t light = 0; light < count; ++light) {
    if (light > 0 && !can_end_kept(v[light - 1])) continue;
    // x_m, the first vertex that is kept behind, is never the light; count: none is kept.
    for (std::size_t m = std::max<std::size_t>(light, 1); m <= std::min(count, light + kMaxDeleted); ++m) {
      if (m < count && !can_end_kept(v[m])) continue;
      const Subpaths::Kept kept{light, count - m};
      const bool usual = fits && m > light && (goes_on(kept) || can_add(kept, m - light, m - light));
      if ((usual || any_addition(kept, m - light)) && visit(kept, m - light)) return true;
    }
  }
  return false;
}

// True if any_range() visits it.
bool BidirectionalMutator::is_range(const transport::path::Path& path, const Subpaths::Kept& kept) const {
  const std::vector<PathVertex>& v = path.vertices;
  const std::size_t light = kept.light, m = v.size() - kept.eye;
  return light < v.size() && m >= std::max<std::size_t>(light, 1) && m <= light + kMaxDeleted &&
         (light == 0 || can_end_kept(v[light - 1])) && (kept.eye == 0 || can_end_kept(v[m])) &&
         any_addition(kept, m - light);
}

struct BidirectionalMutator::Ranges final : Memo {
  double sum = 0;  // of the weights of all
};

const BidirectionalMutator::Ranges& BidirectionalMutator::ranges(const PathState& from) const {
  return from.memo<Ranges>(this, [&] {
    auto made = std::make_unique<Ranges>();
    any_range(from.path, [&](const Subpaths::Kept&, std::size_t deleted) {
      made->sum += kWeightsOfDeletion[deleted];
      return false;
    });
    return made;
  });
}

// Most states are proposals of other mutations, whose ranges nobody asks for.
double BidirectionalMutator::suitability(const PathState& from) const {
  const std::vector<PathVertex>& v = from.path.vertices;
  // An inner vertex of a usual path, with another one beside it, can be made anew.
  if (const std::size_t k = v.size() - 1; k >= 3 && k >= context_.min_edges && k <= context_.max_edges)
    for (std::size_t i = 1; i < k; ++i)
      if (can_end_kept(v[i - 1]) && can_end_kept(v[i + 1])) return 1;
  return any_range(from.path, [](const Subpaths::Kept&, std::size_t) { return true; }) ? 1 : 0;
}

Proposal BidirectionalMutator::propose(const PathState& from, rng::Stream& stream) const {
  double u = stream.next_double() * ranges(from).sum;
  Subpaths::Kept kept;
  std::size_t deleted = 0;
  any_range(from.path, [&](const Subpaths::Kept& range, std::size_t vertices) {
    kept = range;
    deleted = vertices;
    u -= kWeightsOfDeletion[deleted];
    return u < 0;
  });
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
  const auto add = [&](const Range& range) {
    const std::size_t ends = range.kept.light + range.kept.eye, deleted = count - ends,
                      added = to_count - ends;
    double additions = 0, chosen = 0;
    for_each_addition(range.kept, deleted, [&](std::size_t a, double weight) {
      additions += weight;
      if (a == added) chosen = weight;
    });
    if (!(chosen > 0)) return;
    const auto density = subpaths_.log_pdf_area(to, range.kept);
    if (density) sum.add(*density + math::log(range.weight / all.sum * (chosen / additions)));
  };
  // In the order of any_range().
  for (std::size_t kept_light = 0; kept_light <= front; ++kept_light)
    for (std::size_t kept_eye = back + 1; kept_eye-- > 0;) {
      const Subpaths::Kept kept{kept_light, kept_eye};
      if (keeps(kept) && is_range(from.path, kept))
        add({kept, kWeightsOfDeletion[count - kept_light - kept_eye]});
    }
  return sum.value();
}

}  // namespace candela::mcmc
