#include "tests/unit/live_bytes.h"

#include <malloc.h>

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>

namespace {

std::atomic<std::uint64_t> live = 0, peak = 0;

void* counted(std::size_t size) {
  void* const block = std::malloc(size > 0 ? size : 1);
  if (block == nullptr) throw std::bad_alloc();
  const std::uint64_t now = live += ::malloc_usable_size(block);
  std::uint64_t most = peak;
  while (most < now && !peak.compare_exchange_weak(most, now)) {
  }
  return block;
}

void release(void* block) noexcept {
  if (block == nullptr) return;
  live -= ::malloc_usable_size(block);
  std::free(block);
}

}  // namespace

void* operator new(std::size_t size) {
  return counted(size);
}
void* operator new[](std::size_t size) {
  return counted(size);
}
void operator delete(void* block) noexcept {
  release(block);
}
void operator delete[](void* block) noexcept {
  release(block);
}
void operator delete(void* block, std::size_t) noexcept {
  release(block);
}
void operator delete[](void* block, std::size_t) noexcept {
  release(block);
}

namespace candela::test {

std::uint64_t live_bytes() {
  return live;
}
std::uint64_t peak_live_bytes() {
  return peak;
}
void reset_peak_live_bytes() {
  peak = live.load();
}

}  // namespace candela::test
