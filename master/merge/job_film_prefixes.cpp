// The film of a job beyond the border of its prefix.
#include "master/merge/job_film.h"

namespace candela::master {

void JobFilm::set_border(const PrefixBorder& border) {
  if (border.version <= border_.version) return;
  if (border.end != border_.end) merge_ahead();
  border_ = border;
}

// All that can run out of memory comes before the first change that somebody sees.
void JobFilm::merge_ahead() {
  if (!ahead_.film) return;
  Accumulators accumulators;
  for (const auto& [key, sums] : ahead_.accumulators) {
    const auto held = accumulators_.find(key);
    if (held == accumulators_.end()) {
      accumulators.emplace(key, sums);
      continue;
    }
    auto both = std::make_shared<film::MergedAccumulator>(*held->second);
    static_cast<void>(both->merge(*sums));  // of one spec
    accumulators.emplace(key, std::move(both));
  }
  static_cast<void>(film_->merge(*ahead_.film));  // of one layout, and what is ahead is in no other film
  movement_.add(ahead_.movement);
  accumulators.merge(accumulators_);
  accumulators_.swap(accumulators);
  const Lock records_lock(records_mutex_);
  for (auto& [chain, record] : ahead_.records) records_[chain] = std::move(record);
  ahead_ = {};
}

void JobFilm::drop_ahead() {
  const Lock records_lock(records_mutex_);
  ahead_ = {};
}

void JobFilm::move_border(const PrefixBorder& border) {
  const Lock lock(mutex_);
  if (film_) set_border(border);
}

void JobFilm::release_ahead() {
  const Lock lock(mutex_);
  if (film_) merge_ahead();
}

void JobFilm::discard_ahead() {
  const Lock lock(mutex_);
  drop_ahead();
}

}  // namespace candela::master
