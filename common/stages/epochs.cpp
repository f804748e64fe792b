#include "common/stages/epochs.h"

#include <algorithm>

#include "common/job/job.h"

namespace candela {
namespace {

// The epoch that reaches the limit is the last: no border lies beyond its end.
constexpr std::uint64_t kLimit = Limits::max_iterations;

}  // namespace

// An epoch that begins at T has the even length l of the run while max(first, T / growth) is l - 1 or l, that
// is, while T is below (l + 1) * growth.
Epochs::Run Epochs::run_from(std::uint64_t epoch, std::uint64_t begin) const {
  const std::uint64_t least = std::max(first_, begin / growth_);
  Run run{epoch, begin, least + least % 2, 1};
  const std::uint64_t stop =
      run.length >= kLimit / growth_ ? kLimit : std::min(kLimit, (run.length + 1) * growth_);
  if (stop > begin) run.count = (stop - begin + run.length - 1) / run.length;
  return run;
}

std::uint64_t Epochs::begin(std::uint64_t epoch) const {
  Run run = run_from(0, 0);
  while (epoch >= run.epoch + run.count && run.end() < kLimit)
    run = run_from(run.epoch + run.count, run.end());
  return run.begin + std::min(epoch - run.epoch, run.count) * run.length;
}

std::uint64_t Epochs::of_iteration(std::uint64_t iteration) const {
  Run run = run_from(0, 0);
  while (iteration >= run.end() && run.end() < kLimit) run = run_from(run.epoch + run.count, run.end());
  return run.epoch + std::min((iteration - run.begin) / run.length, run.count);
}

}  // namespace candela
