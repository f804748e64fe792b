// Serves audits from the store and the films: the merged units of workers that are distrusted, and jobs
// that begin anew. docs/decisions/080-audits.md
#pragma once

#include <string>
#include <vector>

#include "master/jobs/job_table.h"
#include "master/jobs/job_upkeep.h"
#include "master/jobs/wake_signal.h"
#include "master/store/store.h"

namespace candela::master {

class AuditKeeper {
 public:
  // All must outlive this object.
  AuditKeeper(JobTable& table, JobUpkeep& upkeep, Store& store, StoreWriter& writer, WakeSignal& wake)
      : table_(table), upkeep_(upkeep), store_(store), writer_(writer), wake_(wake) {}

  // The body of one thread. Returns when the farm stops.
  void loop();

 private:
  Result<void> step();
  Result<void> look_for_doubts(const AuditWork::Doubt& doubt);
  Result<void> begin_anew(const std::string& job_id);
  Result<void> taint(const AuditWork::Tainting& tainting);

  JobTable& table_;
  JobUpkeep& upkeep_;
  Store& store_;
  StoreWriter& writer_;
  WakeSignal& wake_;
  std::vector<AuditWork::Tainting> taints_;  // not done yet
};

}  // namespace candela::master
