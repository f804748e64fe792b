// Conversions of a job's plan of work. Bounds are checked by validate() of common/stages/work_plan.h, which
// needs the job's size.
#include <fmt/format.h>

#include "common/wire/field_error.h"
#include "common/wire/wire.h"

namespace candela::wire {
namespace {

using film::AccumulatorSpec;

// The numbers of domains are those of the messages.
static_assert(static_cast<int>(AccumulatorSpec::Domain::film) == v1::AccumulatorSpec::DOMAIN_FILM);
static_assert(static_cast<int>(AccumulatorSpec::Domain::table) == v1::AccumulatorSpec::DOMAIN_TABLE);
static_assert(static_cast<int>(AccumulatorSpec::Domain::keys) == v1::AccumulatorSpec::DOMAIN_KEYS);

}  // namespace

void to_proto(const WorkPlan& plan, v1::WorkPlan& out) {
  out.Clear();
  out.mutable_layers()->Assign(plan.layers.begin(), plan.layers.end());
  for (const AccumulatorSpec& spec : plan.accumulators) {
    v1::AccumulatorSpec& to = *out.add_accumulators();
    to.set_name(spec.name);
    to.set_channels(spec.channels);
    to.set_scale_log2(spec.scale_log2);
    to.set_per_epoch(spec.per == AccumulatorSpec::Per::epoch);
    to.set_domain(static_cast<v1::AccumulatorSpec::Domain>(spec.domain));
    to.set_entries(spec.entries);
    to.mutable_key_names()->Assign(spec.key_names.begin(), spec.key_names.end());
  }
  if (plan.chains) to_proto(*plan.chains, *out.mutable_chains());
  if (plan.epochs) {
    v1::EpochPlan& to = *out.mutable_epochs();
    to.set_first(plan.epochs->first);
    to.set_growth(plan.epochs->growth);
    to.set_lag(plan.epochs->lag);
    to.set_rule(plan.epochs->rule);
    to.mutable_constants()->insert(plan.epochs->constants.begin(), plan.epochs->constants.end());
  }
  if (plan.development) {
    v1::DevelopmentPlan& to = *out.mutable_development();
    to.set_name(plan.development->name);
    to.mutable_constants()->insert(plan.development->constants.begin(), plan.development->constants.end());
  }
}

Result<WorkPlan> from_proto(const v1::WorkPlan& message) {
  WorkPlan plan;
  // Bounds before anything is copied: these lists come from outside.
  if (message.layers_size() >= static_cast<int>(film::kMaxLayers))
    return field_error("work.layers",
                       fmt::format("{} layers, at most {}", message.layers_size(), film::kMaxLayers - 1));
  if (message.accumulators_size() > static_cast<int>(film::kMaxAccumulators))
    return field_error("work.accumulators", fmt::format("{} accumulators, at most {}",
                                                        message.accumulators_size(), film::kMaxAccumulators));
  plan.layers.assign(message.layers().begin(), message.layers().end());
  for (const v1::AccumulatorSpec& from : message.accumulators()) {
    if (from.domain() < v1::AccumulatorSpec::DOMAIN_FILM || from.domain() > v1::AccumulatorSpec::DOMAIN_KEYS)
      return field_error("work.accumulators",
                         fmt::format("'{}' has a domain that is not known", from.name()));
    plan.accumulators.push_back({from.name(),
                                 from.channels(),
                                 from.scale_log2(),
                                 from.per_epoch() ? AccumulatorSpec::Per::epoch : AccumulatorSpec::Per::job,
                                 static_cast<AccumulatorSpec::Domain>(from.domain()),
                                 from.entries(),
                                 {from.key_names().begin(), from.key_names().end()}});
  }
  if (message.has_chains()) {
    auto chains = from_proto(message.chains());
    if (!chains.ok()) return std::move(chains).error().with_field("work." + chains.error().field);
    plan.chains = *chains;
  }
  if (message.has_epochs()) {
    const v1::EpochPlan& from = message.epochs();
    plan.epochs = EpochPlan{from.first(),
                            from.growth(),
                            from.lag(),
                            from.rule(),
                            {from.constants().begin(), from.constants().end()}};
  }
  if (message.has_development()) {
    const v1::DevelopmentPlan& from = message.development();
    plan.development = DevelopmentPlan{from.name(), {from.constants().begin(), from.constants().end()}};
  }
  return plan;
}

}  // namespace candela::wire
