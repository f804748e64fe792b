// Memory that deltas leave to each other.
#include <gtest/gtest.h>

#include <string>
#include <thread>
#include <vector>

#include "master/merge/buffer_pool.h"

namespace candela::master {
namespace {

constexpr std::size_t kMega = 1 << 20;

// Claim: memory is empty and large enough, comes from a delta of like size, is one user's at a time, and no
// more is kept than is allowed.
TEST(BufferPool, KeepsWhatItMay) {
  BufferPool pool(10 * kMega);
  const char* first = nullptr;
  {
    auto buffer = pool.take(4 * kMega);
    (*buffer).assign(4 * kMega, 'x');
    first = (*buffer).data();
    EXPECT_EQ(pool.kept_bytes(), 0U);
  }
  EXPECT_GE(pool.kept_bytes(), 4 * kMega);
  {
    auto again = pool.take(3 * kMega);
    EXPECT_TRUE((*again).empty());
    EXPECT_EQ((*again).data(), first);
    auto other = pool.take(4 * kMega);
    EXPECT_NE((*other).data(), first);
    EXPECT_GE((*other).capacity(), 4 * kMega);
    auto third = pool.take(4 * kMega);
  }
  EXPECT_LE(pool.kept_bytes(), 10 * kMega);
  EXPECT_GE(pool.kept_bytes(), 8 * kMega);
  {
    auto small = pool.take(kMega);
    EXPECT_LT((*small).capacity(), 4 * kMega);
  }
  { auto large = pool.take(11 * kMega); }
  EXPECT_LE(pool.kept_bytes(), 10 * kMega);
}

// Claim: threads may take and give back buffers at once; the limit holds.
TEST(BufferPool, ManyThreads) {
  BufferPool pool(3 * kMega);
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&pool, t] {
      const char mark = static_cast<char>('a' + t);
      for (int i = 0; i < 50; ++i) {
        auto buffer = pool.take(kMega);
        (*buffer).assign(kMega, mark);
        EXPECT_EQ((*buffer).find_first_not_of(mark), std::string::npos);
      }
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_LE(pool.kept_bytes(), 3 * kMega);
}

}  // namespace
}  // namespace candela::master
