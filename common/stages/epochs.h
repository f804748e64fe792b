// Epochs: which iterations share one decided state. T_0 = 0 and
//   T_{e+1} - T_e = max(first, floor(T_e / growth)), rounded up to even,
// so that an epoch is the same range of sequence indices in both halves of a job. A border depends on the
// epoch's number alone: a job that is extended goes on in the epoch it was in.
#pragma once

#include <cstdint>

namespace candela {

// Has no table: a border is found by a walk over runs of epochs of one length. T / growth rises by 2 from run
// to run, so the first million iterations have 8 runs at the largest growth, and few at any other.
class Epochs {
 public:
  // Preconditions: first > 0, growth > 0.
  Epochs(std::uint64_t first, std::uint32_t growth) : first_(first), growth_(growth) {}

  // T_e, an iteration. Epochs that begin beyond Limits::max_iterations begin at the first such border.
  std::uint64_t begin(std::uint64_t epoch) const;
  // Epoch of an iteration of the job.
  std::uint64_t of_iteration(std::uint64_t iteration) const;

  // The same for a sequence index of either half.
  std::uint64_t begin_index(std::uint64_t epoch) const { return begin(epoch) / 2; }
  std::uint64_t of_index(std::uint64_t index) const { return of_iteration(2 * index); }

 private:
  // Epochs [epoch, epoch + count) are of this length; the first begins at `begin`.
  struct Run {
    std::uint64_t epoch = 0, begin = 0, length = 0, count = 0;
    std::uint64_t end() const { return begin + count * length; }
  };
  Run run_from(std::uint64_t epoch, std::uint64_t begin) const;

  std::uint64_t first_;
  std::uint32_t growth_;
};

// Number of epochs that the state of epoch e depends on: those below e - lag. All their units are merged when
// it is decided.
constexpr std::uint64_t epochs_before(std::uint64_t epoch, std::uint32_t lag) {
  return epoch > lag ? epoch - lag : 0;
}
// Number of epochs that the first `decisions` decisions have folded. The states from this epoch on are those
// that units still start from and the next decisions need.
constexpr std::uint64_t epochs_folded(std::uint64_t decisions, std::uint32_t lag) {
  return decisions > 0 ? epochs_before(decisions - 1, lag) : 0;
}

}  // namespace candela
