// Huge pages for large arrays whose type is an ordinary std::vector: fewer faults while they are filled,
// fewer misses of the address translation while they are read at random (huge_pages.h).
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace candela {

// Reserves room for `count` elements. From 4 MiB on the system is asked for huge pages.
template <class T>
void reserve_huge(std::vector<T>& list, std::size_t count) {
  constexpr std::uintptr_t kHuge = std::uintptr_t{1} << 21, kPage = 4096;
  list.reserve(count);
  if (count * sizeof(T) < 2 * kHuge) return;
  const std::uintptr_t begin = (reinterpret_cast<std::uintptr_t>(list.data()) + kPage - 1) / kPage * kPage,
                       end = reinterpret_cast<std::uintptr_t>(list.data() + list.capacity()) / kPage * kPage;
  // Advice: no error matters.
  static_cast<void>(::madvise(reinterpret_cast<void*>(begin), end - begin, MADV_HUGEPAGE));
}

}  // namespace candela
