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
    if (Kept* const kept = this_thread(); kept != nullptr && count == 1 && kept->count > 0)
      return static_cast<T*>(kept->blocks[--kept->count]);
    return static_cast<T*>(::operator new (count * sizeof(T), std::align_val_t{alignof(T)}));
  }
  void deallocate(T* block, std::size_t count) {
    if (Kept* const kept = this_thread(); kept != nullptr && count == 1 && kept->count < kept->blocks.size())
      kept->blocks[kept->count++] = block;
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
      ended() = true;
    }
  };
  // True once the thread's blocks are gone: an object may outlive them.
  static bool& ended() {
    thread_local bool value = false;
    return value;
  }
  static Kept* this_thread() {
    if (ended()) return nullptr;
    thread_local Kept kept;
    return &kept;
  }
};

}  // namespace candela
