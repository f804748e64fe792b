#include "common/wire/job_figures.h"

#include <algorithm>

#include "common/wire/wire.h"

namespace candela::wire {

double samples_per_iteration(const v1::JobStatus& status) {
  if (!status.chains().has_plan()) return 1;
  const v1::ChainPlan& plan = status.chains().plan();
  const double pixels = static_cast<double>(status.settings().width()) * status.settings().height();
  return pixels > 0 ? static_cast<double>(plan.segment_mutations()) * plan.chains() / pixels : 0;
}

std::uint64_t iterations_asked(const v1::JobStatus& status) {
  const auto indices = indices_of(status.stop());
  if (!indices.ok() || film::empty(*indices)) return status.stop().iterations();
  const std::uint64_t each = status.has_chains() ? std::max(status.chains().plan().chains(), 1U) : 1;
  return ((*indices)[0].count() + (*indices)[1].count() + each - 1) / each;
}

std::string indices_text(const v1::JobStatus& status) {
  const auto indices = indices_of(status.stop());
  return indices.ok() && !film::empty(*indices) ? film::text_of(*indices) : std::string();
}

}  // namespace candela::wire
