// Tasks over threads whose results are taken in the order of the tasks, so that sums of doubles do not depend
// on threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <optional>
#include <thread>
#include <vector>

namespace candela::inspect {

// make(task) on any thread; take(task, result) on this thread, in order. A few results are held at a time.
template <class Make, class Take>
void for_each_in_order(std::uint64_t tasks, unsigned threads, const Make& make, const Take& take) {
  using Part = decltype(make(std::uint64_t{0}));
  const std::uint64_t wave = std::uint64_t{16} * std::max(1U, threads);
  for (std::uint64_t begin = 0; begin < tasks; begin += wave) {
    const std::uint64_t end = std::min(begin + wave, tasks);
    std::vector<std::optional<Part>> parts(end - begin);
    std::atomic<std::uint64_t> next{begin};
    const auto work = [&] {
      for (std::uint64_t task; (task = next.fetch_add(1)) < end;) parts[task - begin].emplace(make(task));
    };
    {
      std::vector<std::jthread> team;
      for (unsigned i = 1; i < std::min<std::uint64_t>(threads, end - begin); ++i) team.emplace_back(work);
      work();
    }
    for (std::uint64_t task = begin; task < end; ++task) take(task, std::move(*parts[task - begin]));
  }
}

}  // namespace candela::inspect
