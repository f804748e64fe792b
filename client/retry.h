// Trying again: which failures of a call pass, and how long to wait.
#pragma once

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <chrono>
#include <random>
#include <thread>
#include <utility>

namespace candela::client {

inline std::chrono::system_clock::time_point deadline_in(double seconds) {
  return std::chrono::system_clock::now() +
         std::chrono::milliseconds(static_cast<std::int64_t>(seconds * 1000));
}

inline double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

inline bool may_repeat(const grpc::Status& status) {
  return status.error_code() == grpc::StatusCode::UNAVAILABLE ||
         status.error_code() == grpc::StatusCode::RESOURCE_EXHAUSTED;
}

// Transfers have no deadline but of silence, so a deadline is a link that went dead. CANCELLED is a master
// that cut us off, or that ends.
inline bool broke_off(const grpc::Status& status) {
  return may_repeat(status) || status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED ||
         status.error_code() == grpc::StatusCode::CANCELLED;
}

// Time that a transfer has been trying to go on, since the last byte that came.
class Outage {
 public:
  // Begins an outage now, unless one is under way.
  double seconds() {
    if (!std::exchange(on_, true)) since_ = std::chrono::steady_clock::now();
    return seconds_since(since_);
  }
  void end() { on_ = false; }

 private:
  bool on_ = false;
  std::chrono::steady_clock::time_point since_{};
};

// Pauses between tries: 0.1 s doubling to 1 s, less up to a quarter so that many clients do not knock at one
// time.
class Backoff {
 public:
  double next_seconds() {
    const double pause = pause_ * (1 - 0.25 * std::generate_canonical<double, 32>(random_));
    pause_ = std::min(1.0, pause_ * 2);
    return pause;
  }
  void reset() { pause_ = kFirst; }

 private:
  static constexpr double kFirst = 0.1;
  double pause_ = kFirst;
  std::mt19937 random_{std::random_device{}()};
};

inline void sleep_seconds(double seconds) {
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
}

}  // namespace candela::client
