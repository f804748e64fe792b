// Memory that a process may take, and what it does without.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <new>

#include "common/base/memory_limit.h"
#include "tests/temporary_folder.h"

namespace candela {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kNone = std::numeric_limits<std::uint64_t>::max();

void write(const fs::path& file, const char* text) {
  fs::create_directories(file.parent_path());
  std::ofstream(file) << text;
}

// Claim: the least limit counts of a process's control group and of those that it is in, of both versions of
// control groups; "max", a missing file and groups of other things are no limit.
TEST(MemoryLimit, IsTheLeastOfItsControlGroups) {
  const test::TemporaryFolder folder;
  const std::string root = folder.path().string();
  EXPECT_EQ(group_memory_limit("0::/\n", root), kNone);
  write(folder.path() / "memory.max", "max\n");
  EXPECT_EQ(group_memory_limit("0::/\n", root), kNone);
  write(folder.path() / "a" / "memory.max", "5000000000\n");
  write(folder.path() / "a" / "b" / "memory.max", "max\n");
  EXPECT_EQ(group_memory_limit("0::/a/b\n", root), 5000000000U);
  write(folder.path() / "a" / "b" / "memory.max", "3000000000\n");
  EXPECT_EQ(group_memory_limit("0::/a/b\n", root), 3000000000U);
  EXPECT_EQ(group_memory_limit("0::/a\n", root), 5000000000U);
  write(folder.path() / "memory" / "x" / "memory.limit_in_bytes", "2000000000\n");
  EXPECT_EQ(group_memory_limit("12:pids:/x\n4:cpu,memory:/x\n0::/a\n", root), 2000000000U);
  EXPECT_EQ(group_memory_limit("12:pids:/x\n", root), kNone);
  EXPECT_EQ(group_memory_limit("nonsense", root), kNone);
}

TEST(MemoryLimit, IsNoMoreThanTheMachineHas) {
  const std::uint64_t limit = memory_limit_bytes();
  EXPECT_GT(limit, 64U << 20);
  EXPECT_LT(limit, std::uint64_t{1} << 48);
}

// Claim: what runs out of memory is an error that says what could not be done.
TEST(WithinMemory, TurnsALackIntoAnError) {
  const auto result =
      within_memory("the film cannot be read", []() -> Result<int> { throw std::bad_alloc(); });
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().kind, ErrorKind::resource);
  EXPECT_EQ(result.error().to_string(), "the film cannot be read: out of memory");
  EXPECT_EQ(within_memory("x", [] { return Result<int>(7); }).value(), 7);
  EXPECT_FALSE(LargeWork::here());
}

// Claim: an allocation that the system refuses takes the reserve, once; one of large work does not; and the
// reserve comes back.
TEST(MemoryReserve, IsForSmallWorkAlone) {
  // A function call, which no compiler leaves out as it may leave out a new-expression.
  const auto fails = [] {
    try {
      ::operator delete(::operator new (std::size_t{1} << 60));
      return false;
    } catch (const std::bad_alloc&) {
      return true;
    }
  };
  {
    MemoryReserve reserve(1 << 20);
    EXPECT_FALSE(reserve.refill());
    {
      const LargeWork large;
      EXPECT_TRUE(fails());
    }
    EXPECT_FALSE(reserve.refill());
    {
      const LargeWork large;
      const SmallWork small;
      EXPECT_TRUE(fails());
    }
    EXPECT_TRUE(reserve.refill());
    EXPECT_FALSE(reserve.refill());
    EXPECT_TRUE(fails());
    EXPECT_TRUE(reserve.refill()) << "it was there again";
  }
  EXPECT_EQ(std::get_new_handler(), nullptr);
}

}  // namespace
}  // namespace candela
