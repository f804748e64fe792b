// Circumstances of a unit, not its content: but for the fault of tests, nothing here changes its sums.
#pragma once

#include <atomic>
#include <cstdint>

namespace candela::integrators {

struct RunContext {
  unsigned threads = 1;
  const std::atomic<bool>* stop = nullptr;  // set: return early with an ErrorKind::refused error "stopped"
  std::atomic<float>* progress = nullptr;   // in [0, 1]
  std::atomic<std::uint64_t>* steps = nullptr;  // grows with each task, so that who watches sees it go on
  const std::atomic<bool>* cut = nullptr;       // set: a unit of segments begins no other segment
  // For tests of the quarantine: may spoil a sample's r, g, b just before it reaches the film.
  void (*fault)(std::uint64_t sample_key, float* rgb) = nullptr;

  bool stopped() const { return stop != nullptr && stop->load(std::memory_order_relaxed); }
  bool cut_short() const { return cut != nullptr && cut->load(std::memory_order_relaxed); }
};

}  // namespace candela::integrators
