#include "master/jobs/develop.h"

#include <fmt/format.h>

#include "common/stages/development.h"
#include "common/stats/inner_merges.h"

namespace candela::master {

stats::Movement::Bias measured_bias(const JobRow& row, const JobFilm::Snapshot& snapshot) {
  if (!snapshot.film) return {};
  for (std::size_t i = 0; i < row.accumulators.size() && i < snapshot.accumulators.size(); ++i)
    if (row.accumulators[i].name == stats::kInnerMerges)
      return stats::measured_bias({snapshot.accumulators[i][0].get(), snapshot.accumulators[i][1].get()},
                                  row.settings.width, row.settings.height,
                                  static_cast<double>(snapshot.film->merged(0).count()),
                                  static_cast<double>(snapshot.film->merged(1).count()));
  return {};
}

Result<film::Development> develop(const JobRow& row, const JobFilm::Snapshot& snapshot,
                                  std::string_view estimator) {
  film::Development out = development_of(row, snapshot.counts);
  if (!row.development) {
    if (estimator.empty()) return out;
    return usage_error(fmt::format("job {} has one read-out, and no estimator '{}'", row.id, estimator))
        .with_field("estimator");
  }
  const auto sums = [&](std::string_view name, std::uint32_t half) -> const film::MergedAccumulator* {
    for (std::size_t i = 0; i < row.accumulators.size() && i < snapshot.accumulators.size(); ++i)
      if (row.accumulators[i].name == name) return snapshot.accumulators[i][half].get();
    return nullptr;
  };
  const DevelopmentInput input{*row.development, estimator, row.settings.width, row.settings.height, sums};
  CANDELA_ASSIGN(Corrections corrections, correct(input));
  for (std::size_t half = 0; half < 2; ++half)
    if (!corrections[half].empty())
      out.corrections[half] = std::make_shared<const std::vector<float>>(std::move(corrections[half]));
  return out;
}

}  // namespace candela::master
