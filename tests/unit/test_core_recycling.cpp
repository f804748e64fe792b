// Blocks of memory that threads keep.
#include <gtest/gtest.h>

#include <memory>
#include <thread>

#include "worker/core/recycling_allocator.h"

namespace candela {
namespace {

struct Block {
  int value = 0;
};
std::shared_ptr<Block> make(int value) {
  return std::allocate_shared<Block>(RecyclingAllocator<Block>(), Block{value});
}

// Makes objects when its thread has let its blocks go, as it was there before them.
struct Last {
  bool* alone = nullptr;
  ~Last() {
    std::shared_ptr<Block> others[8];  // the heap gives them what the thread has let go
    for (auto& other : others) other = std::make_shared<Block>();
    const auto one = make(1), two = make(2);
    *alone = one->value == 1 && two->value == 2;
    for (const auto& other : others) *alone = *alone && other->value == 0 && other != one && other != two;
  }
};

// Claim: an object that a thread makes at its very end has memory of its own; objects in use never share a
// block, and one that goes to another thread may end there.
TEST(RecyclingAllocator, BlocksAreGivenOnce) {
  bool alone = false;
  std::shared_ptr<Block> carried;
  std::thread([&] {
    thread_local Last last;
    last.alone = &alone;
    std::shared_ptr<Block> kept[6];
    for (int round = 0; round < 3; ++round) {
      for (int i = 0; i < 6; ++i) kept[i] = make(i);
      for (int i = 0; i < 6; ++i) EXPECT_EQ(kept[i]->value, i);
      for (int i = 0; i < 5; ++i) kept[i].reset();
    }
    carried = kept[5];
  }).join();
  EXPECT_TRUE(alone);
  EXPECT_EQ(carried->value, 5);
}

}  // namespace
}  // namespace candela
