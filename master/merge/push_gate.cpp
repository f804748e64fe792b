#include "master/merge/push_gate.h"

#include <fmt/format.h>

#include <algorithm>

namespace candela::master {
namespace {

constexpr int kPushesPerWorker = 2;
constexpr double kSlowestBytesPerSecond = 16 << 10;

// Part of `all` that deltas that yield may have.
template <class Number>
Number share_of(Number all, PushGate::Order order) {
  return order == PushGate::Order::yields ? all / 4 * 3 : all;
}

}  // namespace

PushGate::PushGate(std::uint64_t limit_bytes, unsigned merge_threads)
    : limit_bytes_(limit_bytes), free_turns_(std::max(merge_threads, 1U)) {}

Result<std::unique_ptr<PushGate::Ticket>> PushGate::enter(const std::string& worker_id, std::uint64_t bytes,
                                                          Order order, double now_seconds,
                                                          std::function<void()> cancel) {
  const Lock lock(mutex_);
  const auto of_worker = std::count_if(entries_.begin(), entries_.end(),
                                       [&](const Entry& e) { return e.worker_id == worker_id; });
  if (of_worker >= kPushesPerWorker)
    return resource_error(fmt::format("{} deltas of this worker are under way already", of_worker));
  const std::uint64_t limit = share_of(limit_bytes_, order);
  if (deltas_ >= share_of(kMaxDeltas, order))
    return resource_error(fmt::format("the merge queue is full ({} deltas)", deltas_));
  if (bytes_ > 0 && (bytes > limit || bytes_ > limit - bytes))
    return resource_error(fmt::format("the merge queue is full ({} of {} bytes)", bytes_, limit));
  entries_.push_front({worker_id, bytes, now_seconds, now_seconds, false, std::move(cancel)});
  bytes_ += bytes;
  ++deltas_;
  return std::make_unique<Ticket>(*this, entries_.begin());
}

std::unique_ptr<PushGate::Ticket> PushGate::enter_silent(double now_seconds, std::function<void()> cancel) {
  const Lock lock(mutex_);
  entries_.push_front({"", 0, now_seconds, now_seconds, false, std::move(cancel)});
  return std::make_unique<Ticket>(*this, entries_.begin());
}

std::unique_ptr<PushGate::Ticket> PushGate::enter_unknown(double now_seconds, std::function<void()> cancel) {
  const Lock lock(mutex_);
  std::size_t waiting = 0;
  Entry* oldest = nullptr;
  for (Entry& e : entries_) {  // the newest first
    if (!e.unknown || !e.cancel) continue;
    ++waiting;
    oldest = &e;
  }
  if (waiting >= kMaxUnknown) std::exchange(oldest->cancel, nullptr)();
  entries_.push_front({"", 0, now_seconds, now_seconds, true, std::move(cancel)});
  return std::make_unique<Ticket>(*this, entries_.begin());
}

void PushGate::cancel_hung(double now_seconds, double idle_seconds) {
  const Lock lock(mutex_);
  for (Entry& e : entries_) {
    if (!e.cancel) continue;
    const double longest = idle_seconds + static_cast<double>(e.bytes) / kSlowestBytesPerSecond;
    const bool silent = now_seconds - e.last > (e.unknown ? kUnknownSeconds : idle_seconds);
    const bool slow = e.bytes > 0 && now_seconds - e.started > longest;
    if (!silent && !slow) continue;
    const std::function<void()> cancel = std::exchange(e.cancel, nullptr);
    cancel();
  }
}

double PushGate::retry_seconds(Order order) const {
  const double deltas = static_cast<double>(count()) / (order == Order::at_once ? 4 : 1);
  const Lock lock(turn_mutex_);
  return std::clamp(deltas * turn_seconds_, 0.25, 4.0);
}

std::uint64_t PushGate::bytes_under_way() const {
  const Lock lock(mutex_);
  return bytes_;
}

std::size_t PushGate::waiting_at_once() const {
  const Lock lock(turn_mutex_);
  return waiting_at_once_;
}

std::size_t PushGate::count() const {
  const Lock lock(mutex_);
  return entries_.size();
}

PushGate::Ticket::~Ticket() {
  const Lock lock(gate_.mutex_);
  gate_.bytes_ -= entry_->bytes;
  if (!entry_->worker_id.empty()) --gate_.deltas_;
  gate_.entries_.erase(entry_);
}

void PushGate::Ticket::progress(double now_seconds) {
  const Lock lock(gate_.mutex_);
  entry_->last = now_seconds;
}

void PushGate::Ticket::all_here() {
  const Lock lock(gate_.mutex_);
  entry_->cancel = nullptr;
}

PushGate::MergeTurn::MergeTurn(PushGate& gate, Order order) : gate_(gate) {
  Lock lock(gate_.turn_mutex_);
  if (order == Order::at_once) {
    ++gate_.waiting_at_once_;
    gate_.turn_free_.wait(lock, [&]() CANDELA_REQUIRES(gate_.turn_mutex_) { return gate_.free_turns_ > 0; });
    if (--gate_.waiting_at_once_ == 0) gate_.turn_free_.notify_all();  // the others may go on
  } else {
    gate_.turn_free_.wait(lock, [&]() CANDELA_REQUIRES(gate_.turn_mutex_) {
      return gate_.free_turns_ > 0 && gate_.waiting_at_once_ == 0;
    });
  }
  --gate_.free_turns_;
  begun_ = std::chrono::steady_clock::now();
}

PushGate::MergeTurn::~MergeTurn() {
  {
    const Lock lock(gate_.turn_mutex_);
    ++gate_.free_turns_;
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun_).count();
    gate_.turn_seconds_ += 0.1 * (seconds - gate_.turn_seconds_);
  }
  gate_.turn_free_.notify_all();
}

}  // namespace candela::master
