#include "master/scheduler/open_epochs.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "master/scheduler/unit_source.h"

namespace candela::master {

OpenEpochs::OpenEpochs(const std::optional<EpochPlan>& plan)
    : epochs_(plan ? std::optional<Epochs>({plan->first, plan->growth}) : std::nullopt),
      lag_(plan ? plan->lag : 0) {}

std::uint64_t OpenEpochs::open_end(const JobView& job, std::uint32_t half) const {
  if (!epochs_) return job.open_to[half];
  return std::min(job.open_to[half], epochs_->begin_index(job.states.size()));
}

std::uint64_t OpenEpochs::unit_end(const JobView& job, std::uint64_t begin) const {
  if (!epochs_) return std::numeric_limits<std::uint64_t>::max();
  const std::uint64_t epoch = epochs_->of_index(begin), border = epochs_->begin_index(epoch + 1);
  // Every worker gets some units of an epoch, since all wait for its last one.
  const std::uint64_t length = border - epochs_->begin_index(epoch);
  const std::uint64_t share = length / std::max<std::uint64_t>(job.active_workers, 1);
  return std::min(border, begin + std::max<std::uint64_t>(share, 1));
}

std::uint64_t OpenEpochs::open_indices(const JobView& job) const {
  std::uint64_t open = 0;
  for (std::uint32_t h = 0; h < 2; ++h) {
    const std::uint64_t lacking = missing(job.merged[h], open_end(job, h));
    open += lacking - std::min(lacking, job.unwanted[h]);
  }
  return open;
}

bool OpenEpochs::holds(const JobView& job, const Unit& unit) const {
  if (!epochs_) return true;
  const std::uint64_t epoch = epochs_->of_index(unit.begin);
  return epoch < job.states.size() && unit.end <= epochs_->begin_index(epoch + 1);
}

std::vector<StateRow> OpenEpochs::states(const JobView& job, const Unit& unit) const {
  if (!epochs_) return {};
  return {job.states[epochs_->of_index(unit.begin)]};
}

std::optional<std::uint64_t> OpenEpochs::due_decision(const JobView& job) const {
  if (!epochs_) return std::nullopt;
  const std::uint64_t epoch = job.states.size(), begin = epochs_->begin_index(epoch);
  if (begin >= job.target[0] && begin >= job.target[1]) return std::nullopt;  // the job does not get there
  const std::uint64_t needed = epochs_->begin_index(epochs_before(epoch, lag_));
  for (std::uint32_t h = 0; h < 2; ++h)
    if (!contains(job.merged[h], 0, needed)) return std::nullopt;
  return epoch;
}

bool OpenEpochs::complete(const HalfSets& indices, std::string& why) const {
  const std::uint64_t end = std::max(end_of(indices[0]), end_of(indices[1]));
  if (!epochs_ || end == 0) return true;
  const std::uint64_t last = epochs_->of_index(end - 1);
  const std::uint64_t needed = epochs_->begin_index(epochs_before(last, lag_));
  for (const film::IndexSet& half : indices) {
    if (contains(half, 0, needed)) continue;
    why = fmt::format(
        "the state of epoch {}, which index {} is in, is decided from all indices below {} of both halves",
        last, end - 1, needed);
    return false;
  }
  return true;
}

}  // namespace candela::master
