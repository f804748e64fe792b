// The loop under all others: numbered tasks over threads, with a stop, progress and sample counts.
#pragma once

#include <atomic>
#include <cstdint>
#include <thread>
#include <vector>

#include "common/base/result.h"
#include "common/film/unit_film.h"
#include "worker/integrators/run_context.h"

namespace candela::integrators {

inline Error stopped_error() {
  return refused_error("stopped");
}

// The part of the unit that one loop is, for what is reported as progress: a unit of several loops (light
// paths, then eye paths, iteration after iteration) gives each its own, so that progress only grows.
struct ProgressSpan {
  float begin = 0, end = 1;  // in [0, 1]
};

// Part `part` of `parts` equal ones.
constexpr ProgressSpan progress_part(std::uint64_t part, std::uint64_t parts) {
  return {static_cast<float>(static_cast<double>(part) / static_cast<double>(parts)),
          static_cast<float>(static_cast<double>(part + 1) / static_cast<double>(parts))};
}

// Runs body(task, sample_counts) for the tasks [0, n) on `run.threads` threads and returns n. n is
// task_count; if run.cut is set on the way, n is less, but at least 1. Each thread's sample counts are
// counted into the film. The n tasks are done on return, unless run.stop was set: then the result is an
// error, and the film is not to be used. The body must not depend on the thread and the order of tasks.
template <class Body>
Result<std::uint64_t> for_first_tasks(std::uint64_t task_count, film::UnitFilm& film, const RunContext& run,
                                      const Body& body, ProgressSpan span = {}) {
  std::atomic<std::uint64_t> next{0};
  std::atomic<std::uint64_t> done{0};
  const auto work = [&] {
    film::SampleCounts sample_counts;
    while (!run.stopped()) {
      if (run.cut_short() && next.load(std::memory_order_relaxed) > 0) break;
      const std::uint64_t task = next.fetch_add(1, std::memory_order_relaxed);
      if (task >= task_count) break;
      body(task, sample_counts);
      if (run.stopped()) break;  // perhaps left half done
      if (run.steps != nullptr) run.steps->fetch_add(1, std::memory_order_relaxed);
      const std::uint64_t finished = done.fetch_add(1, std::memory_order_relaxed) + 1;
      if (run.progress != nullptr) {
        const float fraction = static_cast<float>(finished) / static_cast<float>(task_count);
        run.progress->store(span.begin + (span.end - span.begin) * fraction, std::memory_order_relaxed);
      }
    }
    film.count(sample_counts);
  };
  const std::uint64_t threads = std::min<std::uint64_t>(run.threads, task_count);
  if (threads <= 1) {
    work();
  } else {
    std::vector<std::jthread> team;
    team.reserve(threads);
    for (std::uint64_t i = 0; i < threads; ++i) team.emplace_back(work);
  }
  const std::uint64_t begun = std::min(next.load(), task_count);
  const bool fewer = begun < task_count;
  if (done.load() != begun || (fewer && (begun == 0 || !run.cut_short()))) return stopped_error();
  return begun;
}

// All tasks [0, task_count), as for_first_tasks.
template <class Body>
Result<void> for_each_task(std::uint64_t task_count, film::UnitFilm& film, const RunContext& run,
                           const Body& body, ProgressSpan span = {}) {
  RunContext whole = run;
  whole.cut = nullptr;
  CANDELA_TRY(for_first_tasks(task_count, film, whole, body, span));
  return {};
}

}  // namespace candela::integrators
