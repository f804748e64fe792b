// Huge pages for large arrays that are about to be filled. With pages of 4 KiB a quarter of the CPU that
// reading a large mesh took was the kernel's: one fault for each page.
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace candela {

// Asks for huge pages in what whole ones there are within the memory, from two on; where the system has none
// to give it is ordinary memory. Pages that were written before stay as they are.
inline void advise_huge_pages(void* memory, std::size_t bytes) {
  constexpr std::uintptr_t kHuge = std::uintptr_t{1} << 21;
  const auto begin = reinterpret_cast<std::uintptr_t>(memory);
  const std::uintptr_t first = (begin + kHuge - 1) / kHuge * kHuge, end = (begin + bytes) / kHuge * kHuge;
  if (end < first + 2 * kHuge) return;
  // Advice: no error matters.
  static_cast<void>(::madvise(reinterpret_cast<void*>(first), end - first, MADV_HUGEPAGE));
}

// As array.reserve(count).
template <class T>
void reserve_huge(std::vector<T>& array, std::size_t count) {
  if (count <= array.capacity()) return;
  std::vector<T> larger;
  larger.reserve(count);
  advise_huge_pages(larger.data(), count * sizeof(T));
  larger.insert(larger.end(), array.begin(), array.end());
  array.swap(larger);
}

}  // namespace candela
