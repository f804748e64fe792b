#include "worker/mcmc/chain.h"

#include <algorithm>
#include <utility>

#include "common/rng/stream.h"
#include "worker/mcmc/film_deposit.h"

namespace candela::mcmc {
namespace {

// Words of keys.
constexpr std::uint64_t kBootstrap = 0x626f6f74;  // "boot"
constexpr std::uint64_t kChain = 0x636861696e;    // "chain"
enum Purpose : std::uint64_t { decisions, flushed, proposed, independent, segment_end };
constexpr std::uint64_t kPurposes = 1ULL << 40;  // apart from the walks of primary_state.h

std::uint64_t purpose_key(std::uint64_t key, Purpose purpose) {
  return rng::combine(key, kPurposes + purpose);
}

// Mutations between two looks for a stop and reports of progress.
constexpr std::uint64_t kGlance = 16;

// The mollified part of what a state adds, of [0, 1].
double mollified_share(const SplatList& list) {
  return list.scalar() > 0 ? list.mollified_scalar() / list.scalar() : 0;
}

}  // namespace

std::uint64_t bootstrap_key(std::uint64_t seed, std::uint64_t sample) {
  return rng::key(seed, kBootstrap, sample);
}

double usable_scalar(SplatList& list, film::SampleCounts& sample_counts) {
  if (const auto cause = list.fault()) {
    ++sample_counts.rejected[static_cast<std::size_t>(*cause)];
    list.clear();
  }
  return list.scalar();
}

bool run_mutations(Walker& walker, std::uint64_t mutations, const ChainRules& rules,
                   const ChainOutlets& outlets, Deposit& deposit) {
  StateSpace& space = walker.space;
  SplatList& present = walker.present;
  SplatList proposal(present.importance());
  chains::ChainCounts& counts = walker.counts;
  const auto weigh = [&](double scalar) { return 1 / (scalar / rules.b0 + rules.prob_large); };
  double stays = 0;  // expected number of times that the present state was the next one, not yet on the film
  for (std::uint64_t i = 0; i < mutations; ++i) {
    if (i % kGlance == 0) {
      if (outlets.stop != nullptr && outlets.stop->load(std::memory_order_relaxed)) return false;
      if (outlets.progress != nullptr) outlets.progress->add(std::min(kGlance, mutations - i));
    }
    Mutation mutation;
    mutation.key = rng::combine(walker.key, counts.mutations++);
    rng::Stream decide(purpose_key(mutation.key, decisions));
    mutation.large = decide.next_double() < rules.prob_large;
    const double ratio = space.propose(mutation, proposal);
    if (outlets.fault != nullptr && !proposal.splats().empty()) {
      outlets.fault(mutation.key, &proposal.editable()[0].value.r);
      proposal.sum_again();
    }
    const double proposed_scalar = usable_scalar(proposal, outlets.sample_counts);
    if (mutation.large) {
      ++counts.large_steps;
      counts.large_sum += proposed_scalar;
      counts.large_square_sum += proposed_scalar * proposed_scalar;
      if (counts.mollified) {
        const double part = proposal.mollified_scalar();
        counts.mollified->large_sum += part;
        counts.mollified->large_square_sum += part * part;
        counts.mollified->large_product_sum += part * proposed_scalar;
      }
    }
    // Nothing that is not finite, or not a density, is ever accepted: NaN compares false.
    double accept = 0;
    if (proposed_scalar > 0 && ratio > 0)  // from a state that vanished: infinity, and so 1
      accept = std::min(1.0, ratio * (proposed_scalar / walker.scalar));
    stays += 1 - accept;
    if (counts.mollified)
      counts.mollified->stay_sum +=
          accept * mollified_share(proposal) + (1 - accept) * mollified_share(present);
    const bool accepted = decide.next_double() < accept;
    if (proposed_scalar > 0) {
      const double weight = weigh(proposed_scalar);
      if (mutation.large)
        deposit.add(kIndependentLayer, proposal, weight, purpose_key(mutation.key, independent));
      if (!accepted)
        deposit.add(kChainsLayer, proposal, accept * weight, purpose_key(mutation.key, proposed));
    }
    if (accepted) {
      deposit.add(kChainsLayer, present, stays * weigh(walker.scalar), purpose_key(mutation.key, flushed));
      space.accept();
      std::swap(present, proposal);
      walker.scalar = proposed_scalar;
      stays = accept;
      ++counts.accepted;
      if (mutation.large) ++counts.large_accepted;
      counts.present_stay = 0;
    } else {
      space.reject();
      if (++counts.present_stay > counts.longest_stay) {
        counts.longest_stay = counts.present_stay;
        if (present.splats().empty()) continue;  // it vanished, and is nowhere
        const transport::FilmPosition at = present.brightest();
        counts.stay_x = at.x;
        counts.stay_y = at.y;
      }
    }
  }
  deposit.add(kChainsLayer, present, stays * weigh(walker.scalar),
              purpose_key(rng::combine(walker.key, counts.mutations), segment_end));
  return true;
}

Result<void> run_segment(StateSpace& space, const ChainRules& rules, std::uint64_t chain,
                         const chains::ChainStart& start, const ChainOutlets& outlets,
                         chains::ChainRecord& record) {
  Walker walker{space, SplatList(rules.importance), 0, rng::key(rules.seed, kChain, chain),
                start.record.counts};
  record = start.record;
  if (record.segments == 0)
    space.start(bootstrap_key(rules.seed, start.bootstrap_sample), walker.present);
  else
    CANDELA_TRY(space.restore(record.state, walker.present));
  film::SampleCounts unused;  // a start that was rejected was never chosen
  walker.scalar = usable_scalar(walker.present, unused);
  const bool vanished = rules.states_vanish && record.segments > 0 && walker.scalar == 0;
  if (!(walker.scalar > 0 || vanished) ||
      walker.counts.mutations != record.segments * rules.segment_mutations)
    return input_error("the chain cannot start there: it is not a state of this job")
        .with_field("chain_starts");
  if (rules.states_vanish) {
    if (record.segments == 0) walker.counts.mollified = {mollified_share(walker.present), 0, 0, 0, 0, 0};
    if (vanished && walker.counts.mollified) ++walker.counts.mollified->lost;
  }
  FilmDeposit splats(outlets, rules.pixels / static_cast<double>(rules.segment_mutations));
  space.take_counts();  // of another chain
  if (!run_mutations(walker, rules.segment_mutations, rules, outlets, splats)) return {};
  record.counts = walker.counts;
  chains::add(record.counts.by_mutation, space.take_counts());
  ++record.segments;
  record.state = space.save();
  return {};
}

}  // namespace candela::mcmc
