// The decisions of a job of epochs: what the next one is made from, and what it leaves.
#include <fmt/format.h>

#include <utility>

#include "master/merge/job_film.h"

namespace candela::master {

void JobFilm::remember(const DecidedState& state) {
  const Lock lock(mutex_);
  if (film_ && state.epoch == decisions_.states.size()) decisions_.states.push_back(state);
}

std::vector<DecidedState> JobFilm::states() const {
  const Lock lock(mutex_);
  return decisions_.states;
}

std::uint64_t JobFilm::decisions() const {
  const Lock lock(mutex_);
  return decisions_.made;
}

std::shared_ptr<const std::string> JobFilm::state_bytes(std::uint64_t epoch) const {
  const Lock lock(mutex_);
  const auto found = decisions_.bytes.find(epoch);
  return found == decisions_.bytes.end() ? nullptr : found->second;
}

JobFilm::Latest JobFilm::latest() const {
  const Lock lock(mutex_);
  Latest out;
  out.decisions = decisions_.made;
  out.carry = decisions_.carry;
  if (out.decisions > 0) out.state = decisions_.bytes.at(out.decisions - 1);
  for (const auto& [key, sums] : accumulators_) out.statistics_bytes += sums->memory_bytes();
  if (out.carry) {
    out.statistics_bytes += out.carry->memo.size();
    for (const film::MergedAccumulator& sums : out.carry->sums) out.statistics_bytes += sums.memory_bytes();
  }
  return out;
}

std::optional<NextDecision> JobFilm::next_decision() const {
  const Lock lock(mutex_);
  if (!film_ || !epochs_) return std::nullopt;
  return master::next_decision(*film_, accumulators_, decisions_, specs_, *epoch_plan_, *epochs_);
}

Result<bool> JobFilm::fold(MadeDecision made) {
  auto new_bytes = std::make_shared<const std::string>(std::move(made.bytes));
  auto new_carry = std::make_shared<const Carry>(std::move(made.carry));
  // Freed after the lock: hundreds of megabytes.
  std::shared_ptr<const Carry> old_carry;
  std::vector<std::shared_ptr<film::MergedAccumulator>> folded_sums;
  const Lock lock(mutex_);
  const DecidedState& state = made.state;
  const std::uint64_t epoch = state.epoch;
  if (!film_ || !epochs_ || epoch != decisions_.made) return false;
  const std::optional<std::uint64_t> folded = next_folded(epoch, epoch_plan_->lag);
  if (folded && !whole(*film_, *epochs_, *folded + 1)) return false;
  std::vector<DecidedState>& states = decisions_.states;
  if (epoch < states.size() && states[epoch].sha256 != state.sha256)
    return failed_error(fmt::format("the checkpoint has state {} of epoch {}, the sums give {}",
                                    states[epoch].sha256, epoch, state.sha256));
  // All that can run out of memory comes before the first change that somebody sees.
  folded_sums.reserve(specs_.size());
  if (epoch == states.size()) states.reserve(epoch + 1);
  DecidedState decided = state;
  decisions_.bytes.emplace(epoch, std::move(new_bytes));
  if (epoch < states.size())
    states[epoch] = std::move(decided);
  else
    states.push_back(std::move(decided));
  old_carry = std::exchange(decisions_.carry, std::move(new_carry));
  ++decisions_.made;
  for (std::uint32_t i = 0; folded && i < specs_.size(); ++i) {
    if (specs_[i].per != film::AccumulatorSpec::Per::epoch) continue;
    const auto found = accumulators_.find({i, *folded});
    if (found == accumulators_.end()) continue;
    folded_sums.push_back(std::move(found->second));
    accumulators_.erase(found);
  }
  decisions_.bytes.erase(decisions_.bytes.begin(),
                         decisions_.bytes.lower_bound(epochs_folded(decisions_.made, epoch_plan_->lag)));
  return true;
}

}  // namespace candela::master
