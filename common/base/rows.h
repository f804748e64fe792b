// Rows of an image on all processors, for work that is done when somebody asks for an image.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <thread>
#include <vector>

namespace candela {

// Calls f(y) once for each y of [0, rows), on several threads at a time if there are rows enough. f must not
// throw, and must depend on no other row.
template <class F>
void for_each_row(std::uint32_t rows, const F& f) {
  constexpr std::uint32_t kBlock = 16, kMaxThreads = 16;
  std::atomic<std::uint32_t> next{0};
  const auto work = [&] {
    for (std::uint32_t begin = next.fetch_add(kBlock); begin < rows; begin = next.fetch_add(kBlock))
      for (std::uint32_t y = begin; y < std::min(begin + kBlock, rows); ++y) f(y);
  };
  const std::uint32_t blocks = (rows + kBlock - 1) / kBlock;
  std::vector<std::jthread> others;
  for (std::uint32_t i = 1;
       i < std::min({blocks, kMaxThreads, std::max(1U, std::thread::hardware_concurrency())}); ++i)
    others.emplace_back(work);
  work();
}

}  // namespace candela
