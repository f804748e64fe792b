// Finds out that somebody set the wall clock back. gRPC 1.51 turns each timer into a time of day and waits
// for it (grpc/grpc issue 32176): after the clock is set back by an hour, gRPC ends no call at its deadline
// and makes no new connection for an hour.
#pragma once

#include <chrono>
#include <optional>

namespace candela {

class SetBackWatch {
 public:
  using Seconds = std::chrono::duration<double>;

  // look() reports no step up to `limit`: gRPC's timers are late by that much.
  explicit SetBackWatch(Seconds limit) : limit_(limit) {}

  // Returns by how much the wall clock was set back, once for each time that this is more than the limit.
  // `steady` is the time of a clock that only goes forward. The caller looks every few seconds.
  std::optional<Seconds> look(Seconds wall, Seconds steady);
  std::optional<Seconds> look();  // of this machine

 private:
  Seconds limit_;
  std::optional<Seconds> ahead_;  // the largest wall - steady since the last step back
};

}  // namespace candela
