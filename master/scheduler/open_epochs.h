// Epochs of a job's units: no unit crosses a border, and an epoch is open when its state is decided. The
// state of epoch e is decided when all units of the epochs below e - lag are merged, so lag + 1 epochs are
// open at a time and no worker waits at a border. Without a plan all indices are of one epoch without a
// state, which is open.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/job/job.h"
#include "common/stages/epochs.h"
#include "common/stages/work_plan.h"
#include "master/scheduler/index_sets.h"
#include "master/store/records.h"

namespace candela::master {

struct JobView;

class OpenEpochs {
 public:
  explicit OpenEpochs(const std::optional<EpochPlan>& plan);
  // One past the last index of a half that can be rendered now.
  std::uint64_t open_end(const JobView& job, std::uint32_t half) const;
  // One past the last index that a unit which begins here may have.
  std::uint64_t unit_end(const JobView& job, std::uint64_t begin) const;
  // Indices below open_end() that are not merged and are asked for.
  std::uint64_t open_indices(const JobView& job) const;
  // True if the unit is of one epoch, which is open.
  bool holds(const JobView& job, const Unit& unit) const;
  // The states that a unit starts from. Precondition: holds().
  std::vector<StateRow> states(const JobView& job, const Unit& unit) const;

  // As of UnitSource.
  std::optional<std::uint64_t> due_decision(const JobView& job) const;
  bool complete(const HalfSets& indices, std::string& why) const;

 private:
  const std::optional<Epochs> epochs_;
  const std::uint32_t lag_;
};

}  // namespace candela::master
