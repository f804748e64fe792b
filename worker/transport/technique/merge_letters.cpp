#include "worker/transport/technique/merge_letters.h"

namespace candela::transport {

void MergeLetters::start_some() {
  parts_.clear();
  states_ = eye_->states();
}

void MergeLetters::add(const ScatterPoint& v, Vec3 wi, const ChannelStates& light, const Spectrum& value) {
  add(eye_->letters().of(v, wi, TransportMode::radiance, eye_->next_key()), light, value);
}

void MergeLetters::add(std::uint32_t medium, Vec3 p, const ChannelStates& light, const Spectrum& value) {
  add(eye_->letters().in_medium(medium, p), light, value);
}

void MergeLetters::add(const ChannelClasses& token, const ChannelStates& light, const Spectrum& value) {
  parts_.add(eye_->letters().labels(light, eye_->letters().from_eye(states_, token)), value);
}

void MergeLetters::finish_some(const Spectrum& before, const Spectrum& sum, const Spectrum& factor) {
  eye_->sums().add(before, sum, parts_, factor);
  parts_.clear();
}

}  // namespace candela::transport
