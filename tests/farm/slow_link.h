// A network between two processes on one machine: a TCP proxy that delays, limits and breaks.
#pragma once

#include <atomic>
#include <cstdint>
#include <list>
#include <memory>
#include <string>
#include <thread>

namespace candela::farm {

struct LinkOptions {
  double delay_seconds = 0;             // one way; a round trip has two
  double bytes_per_second = 0;          // each way of each connection; 0: as fast as it goes
  std::uint64_t break_after_bytes = 0;  // of each connection, towards the caller; 0: never
};

class SlowLink {
 public:
  // Listens on a port of its own and passes all connections on to `target` ("127.0.0.1:PORT").
  SlowLink(const std::string& target, const LinkOptions& options);
  ~SlowLink();
  SlowLink(const SlowLink&) = delete;
  SlowLink& operator=(const SlowLink&) = delete;

  // For pieces that come from now on.
  void set_delay(double seconds) { delay_seconds_ = seconds; }
  // Nothing passes while the link is cut; connections stay, and new ones wait.
  void cut(bool is_cut) { cut_ = is_cut; }

  const std::string& address() const { return address_; }
  std::uint64_t bytes_to_caller() const { return to_caller_; }
  std::uint64_t bytes_to_target() const { return to_target_; }
  int breaks() const { return breaks_; }

 private:
  void accept_loop();
  void serve(int caller);

  const LinkOptions options_;
  int target_port_ = 0, listener_ = -1;
  std::string address_;
  std::atomic<double> delay_seconds_;
  std::atomic<bool> over_{false}, cut_{false};
  std::atomic<std::uint64_t> to_caller_{0}, to_target_{0};
  std::atomic<int> breaks_{0};
  std::list<std::thread> connections_;  // of the accepting thread
  std::thread thread_;
};

}  // namespace candela::farm
