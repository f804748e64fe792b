// Stops by error: which prefix of a job is looked at, and what becomes of its units beyond.
#include <fmt/format.h>

#include <algorithm>

#include "master/scheduler/scheduler.h"

namespace candela::master {

bool Scheduler::looks_at_prefixes(const Job& job) {
  return job.row.stop.relmse > 0 && !job.row.repairs_to && job.source->makes_film();
}

PrefixBorder Job::border() const {
  PrefixBorder out;
  out.version = prefix_version;
  if (prefix > 0) out.end.fill(prefix * row.per_round());
  return out;
}

bool Job::prefix_has_promised() const {
  const PrefixBorder border = this->border();
  return end_of(row.promised[0]) <= border.end[0] && end_of(row.promised[1]) <= border.end[1];
}

bool Job::prefixes_done() const {
  return prefix == 0 || prefix * row.per_round() >= std::max(limit(0), limit(1));
}

void Scheduler::place_prefix(Job& job, bool with_units) {
  ++job.prefix_version;
  job.units_ahead = 0;
  job.prefix = 0;
  if (!looks_at_prefixes(job)) return;
  std::uint64_t end = std::max(end_of(job.merged[0]), end_of(job.merged[1]));
  for (const auto& [id, unit] : job.units)
    if (with_units && unit.row.unit.kind == job.source->kind()) end = std::max(end, unit.row.unit.end);
  const std::uint64_t per_round = job.row.per_round();
  job.prefix = prefix_of((end + per_round - 1) / per_round, job.row.chains.has_value());
  if (!with_units) drop_off_step(job);
}

// Indices beyond the step after the prefix would be merged before the prefix is looked at.
void Scheduler::drop_off_step(Job& job) {
  const PrefixBorder border = job.border();
  const std::array<std::uint64_t, 2> open_to = job.view().open_to;
  for (auto next = job.units.begin(); next != job.units.end();) {
    const auto at = next++;
    const Unit unit = at->second.row.unit;
    if (unit.kind != job.source->kind() || at->second.audit) continue;
    const std::uint64_t end = border.end[unit.half];
    if (unit.end <= end || (unit.begin >= end && unit.end <= open_to[unit.half])) continue;
    changes_.emplace_back(DropUnit{at->first});
    job.source->put_back(unit);
    job.units.erase(at);
  }
}

std::optional<Scheduler::WholePrefix> Scheduler::whole_prefix(const std::string& id) const {
  const Job* job = this->job(id);
  if (job == nullptr || job->prefix == 0 || job->finishing || has_ended(job->row.state)) return std::nullopt;
  WholePrefix out;
  out.rounds = job->prefix;
  out.border = job->border();
  for (std::uint32_t half = 0; half < 2; ++half)
    if (!contains(job->merged[half], 0, out.border.end[half])) return std::nullopt;
  out.relmse = job->row.stop.relmse;
  out.chains = job->row.chains.has_value();
  out.may_end = job->prefix_has_promised();
  out.next.end.fill(prefix_after(job->prefix, out.chains) * job->row.per_round());
  out.next.version = job->prefix_version + 1;
  return out;
}

bool Scheduler::prefix_decided(const std::string& id, const WholePrefix& prefix, bool ends, Now now) {
  Job* job = find(id);
  if (job == nullptr || job->finishing || has_ended(job->row.state)) return false;
  if (job->prefix != prefix.rounds) {
    // The film may be at `next`: a version that is newer than that has it agree again.
    ++job->prefix_version;
    place_prefix(*job, true);
    return false;
  }
  if (ends) {
    // Another version: its rule has changed, and it is looked at again.
    if (job->prefix_version != prefix.border.version || job->doubtful()) return false;
    job->row.promised = {};
    drop_ahead(*job, prefix.border, now);
    stop(*job, "relmse", now);
    return true;
  }
  job->prefix = prefix_after(job->prefix, prefix.chains);
  ++job->prefix_version;
  job->units_ahead = 0;
  check_stop(*job, now);
  return false;
}

void Scheduler::drop_ahead(Job& job, const PrefixBorder& border, Now now) {
  std::uint64_t dropped = 0;
  for (std::uint32_t half = 0; half < 2; ++half) {
    film::IndexSet prefix;
    prefix.insert(0, border.end[half]);
    const film::IndexSet ahead = without(job.merged[half], prefix);
    dropped += ahead.count();
    job.merged[half] = without(job.merged[half], ahead);
  }
  if (dropped == 0) return;
  changes_.emplace_back(DropMergedFrom{job.row.id, border.end});
  job.row.iterations = count(job.merged);
  job.row.units_merged -= std::min(job.row.units_merged, job.units_ahead);
  job.units_ahead = 0;
  event(now, job.row.id, "", "dropped",
        fmt::format("{} {} beyond those at which the error is small enough: they would make the image depend "
                    "on who was how fast",
                    dropped, job.source->noun()));
}

bool Scheduler::is_dropped(const Job& job, const Unit& unit) {
  return (job.finishing || has_ended(job.row.state)) && job.row.stop_reason == "relmse" &&
         unit.begin >= job.border().end[unit.half];
}

void Scheduler::recount(const std::string& id, const film::SampleCounts& sample_counts, Now now) {
  Job* job = find(id);
  if (job == nullptr) return;
  job->row.sample_counts = sample_counts;
  save(*job, now);
}

}  // namespace candela::master
