// Loops over parts of an array. What they compute may not depend on how the parts are cut, so that results
// are the same for any number of threads; that number is the calling task arena's.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <functional>
#include <vector>

namespace candela::loaders {

inline constexpr std::size_t kGrain = 16384;
inline constexpr std::size_t kNowhere = ~std::size_t{0};

// The calling task arena's threads.
std::size_t thread_count();

// body(i) for all i in [0, count), in any order and at the same time. The one loop that needs TBB's headers,
// which take two seconds to compile.
void for_all(std::size_t count, const std::function<void(std::size_t)>& body);

// body(part, begin, end) for the parts of [0, count), kGrain indices each but the last.
void for_parts(std::size_t count,
               const std::function<void(std::size_t part, std::size_t begin, std::size_t end)>& body);

// body(begin, end) over [0, count).
template <class Body>
void for_ranges(std::size_t count, const Body& body) {
  if (count <= kGrain) {
    if (count > 0) body(std::size_t{0}, count);
    return;
  }
  for_parts(count, [&](std::size_t /*part*/, std::size_t begin, std::size_t end) { body(begin, end); });
}

// The least index in [0, count) of which bad(index) is true; kNowhere: none. Calls `bad` for others too, at
// most once for each.
template <class Predicate>
std::size_t first_where(std::size_t count, const Predicate& bad) {
  std::atomic<std::size_t> least{kNowhere};
  for_ranges(count, [&](std::size_t begin, std::size_t end) {
    const std::size_t known = least.load(std::memory_order_relaxed);
    std::size_t i = begin;
    while (i < end && i < known && !bad(i)) ++i;
    if (i >= end || i >= known) return;
    std::size_t best = known;
    while (i < best && !least.compare_exchange_weak(best, i, std::memory_order_relaxed)) {
    }
  });
  return least.load(std::memory_order_relaxed);
}

// body(index, sum) for all of [0, count), each part with a sum of its own; the parts' sums are then added
// with T::add.
template <class T, class Body>
T joined_over(std::size_t count, T zero, const Body& body) {
  std::vector<T> sums((count + kGrain - 1) / kGrain, zero);
  for_parts(count, [&](std::size_t part, std::size_t begin, std::size_t end) {
    T sum = zero;
    for (std::size_t i = begin; i < end; ++i) body(i, sum);
    sums[part] = sum;
  });
  T all = zero;
  for (const T& sum : sums) all.add(sum);
  return all;
}

}  // namespace candela::loaders
