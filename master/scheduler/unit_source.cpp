#include "master/scheduler/unit_source.h"

#include <algorithm>
#include <limits>

#include "common/stats/error_context.h"

namespace candela::master {

std::uint64_t UnitSource::max_unit(const JobView&) const {
  return std::numeric_limits<std::uint64_t>::max();
}

bool UnitSource::take(const JobView& job, const Unit& unit) {
  return unit.begin < unit.end && claim(job.merged, unit) == Claim::open && ready(job, unit) &&
         reserved_[unit.half].insert(unit.begin, unit.end);
}

void UnitSource::put_back(const Unit& unit) {
  film::IndexSet part;
  if (unit.half < 2 && part.insert(unit.begin, unit.end))
    reserved_[unit.half] = without(reserved_[unit.half], part);
}

Claim UnitSource::claim(const HalfSets& merged, const Unit& unit) const {
  if (unit.kind != kind() || unit.half > 1) return Claim::foreign;
  return merged[unit.half].intersects(unit.begin, unit.end) ? Claim::merged : Claim::open;
}

UnitInput UnitSource::input(const JobView&, const Unit&, FilmInputs::Records) const {
  return {};
}

Result<void> UnitSource::add(const Unit&, std::span<const float>) {
  return input_error("the job has no table now").with_field("contributions");
}

Extent film_extent(const JobView& job, const HalfSets& reserved) {
  Extent out;
  out.bounded = job.bounded;
  for (std::uint32_t h = 0; h < 2; ++h) {
    // A job that was cancelled and extended may have some beyond its target.
    const std::uint64_t lacking = missing(reserved[h], job.target[h]);
    out.remaining += lacking;
    out.cut += reserved[h].count() - std::min(reserved[h].count(), job.unwanted[h]);
  }
  return out;
}

std::unique_ptr<UnitSource> make_source(const JobRow& row) {
  if (!row.named_state) return row.chains ? make_bootstrap_source(*row.chains) : make_pilot_source();
  return make_film_source(row);
}

std::unique_ptr<UnitSource> make_film_source(const JobRow& row) {
  if (row.chains) return make_segment_source(*row.chains, row.epochs);
  const bool moves = stats::context_of(row.settings.integrator_settings, row.plan).alpha < 1;
  return make_iteration_source(row.epochs, moves);
}

}  // namespace candela::master
