// Storage for large arrays that are read at random. With pages of 4 KiB such a read misses the address
// translation as well as the cache, which costs more than the data where page tables are nested (virtual
// machines): 64-byte reads at random from 64 MiB took 100 to 190 ns, with pages of 2 MiB 17 to 23 ns.
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdlib>
#include <memory>
#include <new>
#include <utility>
#include <vector>

namespace candela {

// Asks for huge pages from 4 MiB on; where the system has none to give it is ordinary memory. Elements that
// resize() or the constructor from a size makes are default-initialized: numbers are left as they are, so
// that the threads which fill an array also share the work of having its pages cleared.
template <class T>
struct HugePageAllocator {
  using value_type = T;
  static constexpr std::size_t kHuge = std::size_t{1} << 21;

  HugePageAllocator() = default;
  template <class U>
  HugePageAllocator(const HugePageAllocator<U>&) {}

  T* allocate(std::size_t count) {
    if (count > (~std::size_t{0} - kHuge) / sizeof(T)) throw std::bad_array_new_length();
    if (count * sizeof(T) < 2 * kHuge) return std::allocator<T>().allocate(count);
    const std::size_t bytes = (count * sizeof(T) + kHuge - 1) / kHuge * kHuge;
    void* memory = std::aligned_alloc(kHuge, bytes);
    if (memory == nullptr) throw std::bad_alloc();
    static_cast<void>(madvise(memory, bytes, MADV_HUGEPAGE));  // advice: no error matters
    return static_cast<T*>(memory);
  }
  void deallocate(T* memory, std::size_t count) {
    if (count * sizeof(T) < 2 * kHuge) {
      std::allocator<T>().deallocate(memory, count);
    } else {
      std::free(memory);
    }
  }
  template <class U>
  void construct(U* place) {
    ::new (static_cast<void*>(place)) U;
  }
  template <class U, class First, class... Rest>
  void construct(U* place, First&& first, Rest&&... rest) {
    std::construct_at(place, std::forward<First>(first), std::forward<Rest>(rest)...);
  }
  friend bool operator==(const HugePageAllocator&, const HugePageAllocator&) { return true; }
};

template <class T>
using HugeVector = std::vector<T, HugePageAllocator<T>>;

}  // namespace candela
