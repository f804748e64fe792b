#include "common/wire/stall_guard.h"

namespace candela::wire {

StallGuard::StallGuard(grpc::ClientContext& context, Clock::duration limit)
    : context_(context), deadline_(Clock::now() + limit), thread_([this] { watch(); }) {}

StallGuard::~StallGuard() {
  {
    const Lock lock(mutex_);
    over_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void StallGuard::allow(Clock::duration limit) {
  const auto deadline = Clock::now() + limit;
  bool earlier = false;
  {
    const Lock lock(mutex_);
    earlier = deadline < deadline_;
    deadline_ = deadline;
  }
  if (earlier) changed_.notify_all();  // a later one is found when the thread wakes
}

grpc::Status StallGuard::judge(const grpc::Status& status) {
  const Lock lock(mutex_);
  if (status.ok() || !fired_) return status;
  return {grpc::StatusCode::DEADLINE_EXCEEDED, "nothing moved for too long"};
}

void StallGuard::watch() {
  Lock lock(mutex_);
  while (!over_) {
    if (Clock::now() >= deadline_) {
      fired_ = true;
      context_.TryCancel();
      return;
    }
    changed_.wait_until(lock, deadline_);
  }
}

}  // namespace candela::wire
