// An allocator for objects that are made and thrown away all the time, one or two at once: each thread keeps
// a few of their blocks, which the heap would take apart and put together again.
#pragma once

#include <array>
#include <cstddef>
#include <new>

namespace candela {

template <class T>
class RecyclingAllocator {
 public:
  using value_type = T;

  RecyclingAllocator() = default;
  template <class U>
  RecyclingAllocator(const RecyclingAllocator<U>&) {}  // NOLINT(google-explicit-constructor)

  T* allocate(std::size_t count) {
    Kept& kept = this_thread();
    if (count == 1 && kept.count > 0) return static_cast<T*>(kept.blocks[--kept.count]);
    return static_cast<T*>(::operator new (count * sizeof(T), std::align_val_t{alignof(T)}));
  }
  void deallocate(T* block, std::size_t count) {
    Kept& kept = this_thread();
    if (count == 1 && kept.count < kept.blocks.size())
      kept.blocks[kept.count++] = block;
    else
      release(block);
  }
  template <class U>
  friend bool operator==(const RecyclingAllocator&, const RecyclingAllocator<U>&) {
    return true;
  }

 private:
  static void release(void* block) { ::operator delete (block, std::align_val_t{alignof(T)}); }

  struct Kept {
    std::array<void*, 4> blocks;
    std::size_t count = 0;
    ~Kept() {
      while (count > 0) release(blocks[--count]);
      count = blocks.size();  // what outlives the thread is kept no more
    }
  };
  static Kept& this_thread() {
    thread_local Kept kept;
    return kept;
  }
};

}  // namespace candela
