// Whether the wall clock was set back. gRPC 1.51 turns each of its timers into a time of day and waits for
// that (grpc/grpc issue 32176): after the clock was set back by an hour, no deadline and no new attempt to
// connect comes for an hour.
#pragma once

#include <chrono>
#include <optional>

namespace candela {

class SetBackWatch {
 public:
  using Seconds = std::chrono::duration<double>;

  // Smaller steps than `limit` are waited for.
  explicit SetBackWatch(Seconds limit) : limit_(limit) {}

  // To be called now and then, with the time of day and that of a clock that only goes forward. By how much
  // the clock was set back, once it is more than the limit.
  std::optional<Seconds> look(Seconds wall, Seconds steady);
  std::optional<Seconds> look();  // of this machine

 private:
  Seconds limit_;
  std::optional<Seconds> ahead_;  // the wall clock before the steady one, at most
};

}  // namespace candela
