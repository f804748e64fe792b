// Loops over parts of an array. What they compute may not depend on how the parts are cut, so that results
// are the same for any number of threads; that number is the calling task arena's.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cstddef>

namespace candela::loaders {

inline constexpr std::size_t kGrain = 16384;
inline constexpr std::size_t kNowhere = ~std::size_t{0};

// body(begin, end) over [0, count).
template <class Body>
void for_ranges(std::size_t count, const Body& body) {
  if (count <= kGrain) {
    if (count > 0) body(std::size_t{0}, count);
    return;
  }
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, kGrain),
                    [&](const tbb::blocked_range<std::size_t>& r) { body(r.begin(), r.end()); });
}

// The least index in [0, count) of which bad(index) is true; kNowhere: none. Calls `bad` for others too, at
// most once for each.
template <class Predicate>
std::size_t first_where(std::size_t count, const Predicate& bad) {
  const auto scan = [&](std::size_t begin, std::size_t end, std::size_t best) {
    for (std::size_t i = begin; i < end && i < best; ++i) {
      if (bad(i)) return i;
    }
    return best;
  };
  if (count <= kGrain) return scan(0, count, kNowhere);
  return tbb::parallel_reduce(
      tbb::blocked_range<std::size_t>(0, count, kGrain), kNowhere,
      [&](const tbb::blocked_range<std::size_t>& r, std::size_t best) {
        return scan(r.begin(), r.end(), best);
      },
      [](std::size_t a, std::size_t b) { return std::min(a, b); });
}

// body(index, sum) for all of [0, count), each part with a sum of its own; the parts' sums are then added
// with T::add, which must not care for the order (as least and greatest do not).
template <class T, class Body>
T joined_over(std::size_t count, T zero, const Body& body) {
  const auto part = [&](std::size_t begin, std::size_t end, T sum) {
    for (std::size_t i = begin; i < end; ++i) body(i, sum);
    return sum;
  };
  if (count <= kGrain) return part(0, count, zero);
  return tbb::parallel_reduce(
      tbb::blocked_range<std::size_t>(0, count, kGrain), zero,
      [&](const tbb::blocked_range<std::size_t>& r, T sum) { return part(r.begin(), r.end(), sum); },
      [](T a, const T& b) {
        a.add(b);
        return a;
      });
}

}  // namespace candela::loaders
