// Progress of a job as one line: redrawn in place on a terminal, repeated now and then elsewhere, silent when
// asked.
#pragma once

#include <chrono>
#include <cstdint>
#include <iosfwd>
#include <string>
#include <string_view>
#include <vector>

#include "candela/v1/job.pb.h"

namespace candela::client {

// "64 spp" of so many iterations, or "64 iterations" where it is not known.
std::string effort_text(const v1::JobStatus& status, std::uint64_t iterations);

// "42%  54/128 spp, 12.3 spp/s, relMSE 1.2e-03 (at most 3.1e-03), to 1.0e-03, ETA 1m05s, memory 512.0 MiB":
// the parts that are known. The memory is that of the largest worker.
std::string format_progress(const v1::JobStatus& status);

// Progress of a job in [0, 1]: the furthest of its limits.
double fraction_done(const v1::JobStatus& status);

// "relMSE 1.2e-03 (at most 3.1e-03)": the estimate and the upper end of its interval, if that is known.
// Precondition: the estimate is finite.
std::string relmse_text(const v1::JobStatus& status);
// The notes of the job's plan on light that its integrator finds by luck alone, or never: that light may be
// in no estimate of the error.
std::vector<std::string> lucky_light(const v1::JobStatus& status);

// "3 samples: nan", or "the statistics of 3 eye paths: ...".
std::string rejected_text(const v1::RejectedSamples& rejected);
// Tells of light that is missing since Russian roulette ended walks at its bound on edges. Empty if it ended
// at most one walk in a thousand.
std::string bounded_walks_warning(const v1::JobStatus& status);
// The tests assume independent merges. Merges of one light path are not independent: if 10 % repeat a path,
// at least twice as many even discs are rejected. Empty up to 2 %.
std::string repeats_warning(const v1::JobStatus& status);
// All that a job's end warns of: samples that were rejected, the two above, and lucky_light().
std::vector<std::string> warnings_of(const v1::JobStatus& status);

class ProgressLine {
 public:
  enum class Mode { terminal, plain, quiet };
  // terminal where standard error is one, else plain; quiet if asked.
  static Mode mode_for(bool quiet);

  ProgressLine(std::ostream& err, Mode mode) : err_(err), mode_(mode) {}
  ~ProgressLine() { clear(); }
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  // Shows the line now on a terminal; elsewhere if `important` or a few seconds after the last.
  void show(std::string_view line, bool important = false);
  // Takes the line off the terminal, so that other text can follow.
  void clear();
  std::uint32_t interval_ms() const { return mode_ == Mode::terminal ? 200 : 1000; }

 private:
  std::ostream& err_;
  Mode mode_;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point last_{};
};

}  // namespace candela::client
