#include "master/merge/decisions.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "common/base/hash.h"

namespace candela::master {
namespace {

bool equal(const Carry& a, const Carry& b) {
  return a.memo == b.memo &&
         std::equal(a.sums.begin(), a.sums.end(), b.sums.begin(), b.sums.end(),
                    [](const auto& x, const auto& y) { return x.serialise() == y.serialise(); });
}

}  // namespace

std::optional<std::uint64_t> next_folded(std::uint64_t decisions, std::uint32_t lag) {
  return decisions > lag ? std::optional(decisions - 1 - lag) : std::nullopt;
}

bool whole(const film::MergedFilm& film, const Epochs& epochs, std::uint64_t count) {
  const std::uint64_t end = epochs.begin_index(count);
  for (std::uint32_t h = 0; end > 0 && h < 2; ++h) {
    const auto [gap_begin, gap_end] = film.merged(h).first_gap(0, end);
    if (gap_begin != gap_end) return false;
  }
  return true;
}

std::optional<NextDecision> next_decision(const film::MergedFilm& film, const Accumulators& accumulators,
                                          const Decisions& decisions,
                                          std::span<const film::AccumulatorSpec> specs, const EpochPlan& plan,
                                          const Epochs& epochs) {
  const film::Layout& layout = film.layout();
  NextDecision out;
  out.epoch = decisions.made;
  out.folded = next_folded(decisions.made, plan.lag);
  if (out.folded && !whole(film, epochs, *out.folded + 1)) return std::nullopt;
  out.carry = decisions.carry
                  ? decisions.carry
                  : std::make_shared<const Carry>(empty_carry(specs, layout.width, layout.height));
  if (out.epoch > 0) out.previous = decisions.bytes.at(out.epoch - 1);
  if (!out.folded) return out;
  out.folded_state = decisions.bytes.at(*out.folded);
  for (std::uint32_t i = 0; i < specs.size(); ++i) {
    if (specs[i].per != film::AccumulatorSpec::Per::epoch) continue;
    std::shared_ptr<const film::MergedAccumulator> sums;
    if (const auto found = accumulators.find({i, *out.folded}); found != accumulators.end())
      sums = found->second;
    else
      sums = std::make_shared<const film::MergedAccumulator>(layout.width, layout.height, specs[i]);
    out.sums.push_back(std::move(sums));
  }
  return out;
}

Result<MadeDecision> make(const NextDecision& next, const EpochPlan& plan, const film::Layout& layout) {
  DecisionInput input{plan, next.epoch, layout.width, layout.height, {}, {}};
  if (next.previous) input.previous = *next.previous;
  if (next.folded) {
    input.folded = {*next.folded, *next.folded_state, {}};
    for (const auto& sums : next.sums) input.folded->sums.push_back(sums.get());
  }
  MadeDecision out{{plan.rule, next.epoch, {}, 0}, {}, *next.carry};
  CANDELA_ASSIGN(out.bytes, decide(input, out.carry));
  out.state.sha256 = sha256_hex(out.bytes);
  out.state.size_bytes = out.bytes.size();
  return out;
}

std::string contradiction(const ParsedCheckpoint& older, const ParsedCheckpoint& newer,
                          const CheckpointShape& shape) {
  if (!shape.epochs) return {};
  const auto& before = older.decisions;
  const auto& after = newer.decisions;
  for (std::size_t e = 0; e < std::min(before.states.size(), after.states.size()); ++e)
    if (before.states[e].sha256 != after.states[e].sha256)
      return fmt::format("two checkpoints have different states of epoch {}", e);
  if (before.made == after.made && before.carry && after.carry && !equal(*before.carry, *after.carry))
    return fmt::format("two checkpoints have different sums carried after {} decisions", after.made);
  if (before.made >= after.made) return {};
  const Epochs epochs(shape.epochs->first, shape.epochs->growth);
  const auto next =
      next_decision(older.film, older.accumulators, before, shape.accumulators, *shape.epochs, epochs);
  if (!next) return {};
  const auto again = make(*next, *shape.epochs, older.film.layout());
  if (!again.ok()) return again.error().to_string();
  if (again->state.sha256 != after.states[next->epoch].sha256)
    return fmt::format("the state of epoch {} does not follow from the sums of the checkpoint before",
                       next->epoch);
  if (after.made == next->epoch + 1 && !equal(again->carry, *after.carry))
    return fmt::format("the sums carried after {} decisions do not follow from the checkpoint before",
                       after.made);
  return {};
}

}  // namespace candela::master
