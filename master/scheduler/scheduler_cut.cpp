// Cuts the next unit, and chooses its size.
#include <algorithm>
#include <limits>

#include "master/scheduler/scheduler.h"
#include "master/scheduler/sizing.h"

namespace candela::master {
namespace {

// Until the first delta is merged: a thousand workers would have all taken units too small for the merge by
// then.
double likely_merge_seconds(const Job& job) {
  constexpr double kSecondsPerSum = 9e-9;
  constexpr double kSumsOfKeys = 8;  // of a pixel: the pairs are found, not only added
  double sums = static_cast<double>(film::kChannels) * (1 + static_cast<double>(job.row.layers.size()));
  double in_tables = 0;
  for (const film::AccumulatorSpec& spec : job.row.accumulators) {
    using Domain = film::AccumulatorSpec::Domain;
    if (spec.domain == Domain::film) sums += spec.channels;
    if (spec.domain == Domain::keys) sums += kSumsOfKeys;
    if (spec.domain == Domain::table) in_tables += static_cast<double>(spec.entries) * spec.channels;
  }
  const JobSettings& s = job.row.settings;
  return job.source->makes_film() ? kSecondsPerSum * (sums * s.width * s.height + in_tables) : 0;
}

}  // namespace

UnitState& Scheduler::add_unit(Job& job, const Unit& unit) {
  UnitState state;
  state.row.id = next_unit_id_++;
  state.row.job_id = job.row.id;
  state.row.unit = unit;
  job.maybe_open.insert(state.row.id);
  return job.units.emplace(state.row.id, std::move(state)).first->second;
}

// True if `worker`, were it free, could have a unit of the job.
bool Scheduler::has_work(const Job& job, const WorkerState& worker, Now now) const {
  return job.source->has_unit(job.view()) ||
         std::any_of(job.maybe_open.begin(), job.maybe_open.end(), [&](std::uint64_t id) {
           const auto unit = job.units.find(id);
           return unit != job.units.end() && offered(job, unit->second, worker, now);
         });
}

// An open unit that came back, else a new one.
UnitState* Scheduler::pick(Job& job, const WorkerState& worker, bool prefetch, Now now) {
  UnitSource& source = *job.source;
  const std::uint64_t active = std::max<std::uint64_t>(active_workers(job, now), 1);
  const JobView view = job.view(active);
  const Extent extent = source.extent(view);

  SizingInput in;
  in.unit_seconds = options_.unit_seconds;
  in.seconds_per_iteration = seconds_per_iteration(job, worker) / source.cost().indices_per_iteration;
  in.overhead_seconds = job.overhead_seconds;
  in.merge_seconds = job.merge_seconds > 0 ? job.merge_seconds : likely_merge_seconds(job);
  in.active_workers = active;
  in.remaining = extent.bounded ? extent.remaining : 0;
  if (job.prefix > 0) {
    // Every worker gets some units of a prefix, since all wait for its last one.
    std::uint64_t open_now = 0;
    for (std::uint32_t half = 0; half < 2; ++half)
      open_now += missing(source.reserved()[half], view.open_to[half]);
    in.remaining = std::max<std::uint64_t>(open_now, 1);
  }
  if (source.makes_film() && !job.level) {
    if (job.row.stop.time_seconds > 0)
      in.seconds_left = std::max(job.row.stop.time_seconds - job.row.elapsed_seconds, 1e-3);
    in.open_end = job.row.stop.time_seconds > 0 || job.row.stop.relmse > 0;
  }
  in.cut_so_far = extent.cut;

  UnitState* open = nullptr;
  std::uint64_t open_count = 0;
  for (auto id = job.maybe_open.begin(); id != job.maybe_open.end();) {
    const auto unit = job.units.find(*id);
    if (unit == job.units.end() || !unit->second.leases.empty()) {
      id = job.maybe_open.erase(id);
      continue;
    }
    ++id;
    UnitState& u = unit->second;
    if (u.waits(now.seconds)) continue;
    ++open_count;
    if (open == nullptr && offered(job, u, worker, now)) open = &u;
  }
  if (prefetch && extent.bounded) {
    // The size of a full unit, not of the guided one: else there are always two a worker left.
    SizingInput full = in;
    full.remaining = 0;
    if (!full.open_end) full.cut_so_far = std::numeric_limits<std::uint64_t>::max();
    const std::uint64_t size = std::min(unit_iterations(full), source.max_unit(view));
    if (open_count + extent.remaining / size <= 2 * active) return nullptr;
  }
  if (open != nullptr) return open;
  if (extent.remaining == 0) return nullptr;
  // It has all it was asked for, and waits for what is looked at again.
  if (job.doubtful() && !stop_due(job).empty()) return nullptr;
  // The prefix before what is beyond it, and no unit across its border.
  const PrefixBorder border = job.border();
  for (const bool beyond : {false, true}) {
    JobView part = view;
    for (std::uint32_t half = 0; !beyond && half < 2; ++half)
      part.open_to[half] = std::min(part.open_to[half], border.end[half]);
    if (const std::optional<Unit> unit = source.cut(part, unit_iterations(in))) return &add_unit(job, *unit);
    if (job.prefix == 0) break;
  }
  return nullptr;
}

// A unit that takes much longer than it should, when there is nothing else to do.
UnitState* Scheduler::straggler(Job& job, const WorkerState& worker, Now now) {
  UnitState* slowest = nullptr;
  double slowest_late = 0;
  for (auto& [id, u] : job.units) {
    if (u.leases.size() != 1 || u.speculated) continue;
    const Lease& lease = leases_.at(u.leases[0]);
    if (lease.row.worker_id == worker.row.id) continue;
    if (u.waits(now.seconds) || barred(job, u, worker, now) || !may_answer(job, u, worker, now)) continue;
    const double floor = std::max(options_.unit_seconds, job.source->cost().min_straggler_seconds);
    const double late = now.seconds - lease.granted - std::max(2 * lease.due_seconds, floor);
    if (late > slowest_late) {
      slowest_late = late;
      slowest = &u;
    }
  }
  return slowest;
}

double Scheduler::expected_seconds(const Job& job, const WorkerState& worker, const Unit& unit) const {
  return seconds_per_iteration(job, worker) * static_cast<double>(unit.end - unit.begin) /
         job.source->cost().indices_per_iteration;
}

}  // namespace candela::master
