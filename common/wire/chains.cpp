// Conversions of what jobs of Markov chains add to the wire.
#include <fmt/format.h>

#include "common/wire/field_error.h"
#include "common/wire/wire.h"

namespace candela::wire {
namespace {

// An error of common/chains, with the message's name before its field.
Error inside(std::string_view message, Error error) {
  error.field = error.field.empty() ? std::string(message) : fmt::format("{}.{}", message, error.field);
  return error;
}

}  // namespace

void to_proto(const ChainPlan& plan, v1::ChainPlan& out) {
  out.Clear();
  out.set_chains(plan.chains);
  out.set_bootstrap_samples(plan.bootstrap_samples);
  out.set_segment_mutations(plan.segment_mutations);
}

Result<ChainPlan> from_proto(const v1::ChainPlan& message) {
  const ChainPlan plan{message.chains(), message.bootstrap_samples(), message.segment_mutations()};
  if (auto valid = chains::validate(plan); !valid.ok()) return inside("chains", std::move(valid).error());
  return plan;
}

void to_proto(const chains::ChainStart& start, v1::ChainStart& out) {
  out.Clear();
  if (start.record.segments == 0)
    out.set_bootstrap_sample(start.bootstrap_sample);
  else
    out.set_record(chains::encode(start.record));
}

Result<chains::ChainStart> from_proto(const v1::ChainStart& message) {
  chains::ChainStart start;
  switch (message.start_case()) {
    case v1::ChainStart::kBootstrapSample:
      if (message.bootstrap_sample() >= chains::kMaxBootstrapSamples)
        return field_error("chain_starts.bootstrap_sample",
                           fmt::format("{} is not below the limit of {}", message.bootstrap_sample(),
                                       chains::kMaxBootstrapSamples));
      start.bootstrap_sample = message.bootstrap_sample();
      return start;
    case v1::ChainStart::kRecord: {
      auto record = chains::decode(message.record());
      if (!record.ok()) return inside("chain_starts", std::move(record).error());
      if (record->segments == 0)
        return field_error("chain_starts.record", "it has no segment behind it: its start is a sample");
      start.record = std::move(*record);
      return start;
    }
    default:
      return field_error("chain_starts.start", "it is missing");
  }
}

void to_proto(const chains::Summary& summary, v1::ChainStatus& out) {
  out.set_b(summary.normalisation.b);
  out.set_b_standard_error(summary.normalisation.standard_error);
  out.set_b_samples(summary.normalisation.samples);
  out.clear_groups();
  for (const chains::ChainCounts& c : summary.groups) {
    v1::ChainGroupStatus& group = *out.add_groups();
    group.set_mutations(c.mutations);
    group.set_accepted(c.accepted);
    group.set_large_steps(c.large_steps);
    group.set_large_accepted(c.large_accepted);
    group.set_longest_stay(c.longest_stay);
    group.set_stay_x(c.stay_x);
    group.set_stay_y(c.stay_y);
    for (const chains::MutationCounts& m : c.by_mutation) {
      v1::MutationStatus& one = *group.add_by_mutation();
      one.set_name(m.name);
      one.set_proposed(m.proposed);
      one.set_accepted(m.accepted);
      for (std::size_t cause = 0; cause < m.failed.size(); ++cause)
        (*one.mutable_failed())[std::string(chains::kMutationFailures[cause])] = m.failed[cause];
      one.set_rays(m.rays);
    }
  }
}

Result<chains::Summary> from_proto(const v1::ChainStatus& message) {
  if (static_cast<std::size_t>(message.groups_size()) != chains::kGroups)
    return field_error("chains.groups",
                       fmt::format("{} groups, not {}", message.groups_size(), chains::kGroups));
  chains::Summary out;
  out.normalisation = {message.b(), message.b_standard_error(), message.b_samples()};
  for (int i = 0; i < message.groups_size(); ++i) {
    const v1::ChainGroupStatus& group = message.groups(i);
    chains::ChainCounts& c = out.groups[static_cast<std::size_t>(i)];
    c.mutations = group.mutations();
    c.accepted = group.accepted();
    c.large_steps = group.large_steps();
    c.large_accepted = group.large_accepted();
    c.longest_stay = group.longest_stay();
    c.stay_x = group.stay_x();
    c.stay_y = group.stay_y();
    for (const v1::MutationStatus& one : group.by_mutation()) {
      chains::MutationCounts m{one.name(), one.proposed(), one.accepted(), {}, one.rays()};
      for (std::size_t cause = 0; cause < m.failed.size(); ++cause) {
        const auto found = one.failed().find(std::string(chains::kMutationFailures[cause]));
        if (found != one.failed().end()) m.failed[cause] = found->second;
      }
      c.by_mutation.push_back(std::move(m));
    }
  }
  return out;
}

}  // namespace candela::wire
