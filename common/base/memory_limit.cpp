#include "common/base/memory_limit.h"

#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <sstream>
#include <utility>

namespace candela {
namespace {

constexpr std::uint64_t kNoLimit = std::numeric_limits<std::uint64_t>::max();

// A file of the kernel with one number; "max" and what cannot be read are no limit.
std::uint64_t limit_in(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::string text;
  std::uint64_t value = 0;
  if (!(in >> text)) return kNoLimit;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  return code == std::errc() && end == text.data() + text.size() ? value : kNoLimit;
}

// A group's own limit and those of the groups that it is in.
std::uint64_t limit_up(const std::string& root, std::string_view group, const char* file) {
  std::filesystem::path at(group);
  std::uint64_t least = kNoLimit;
  for (;;) {
    least = std::min(least, limit_in(std::filesystem::path(root + at.string()) / file));
    if (!at.has_relative_path()) return least;
    at = at.parent_path();
  }
}

std::uint64_t page_bytes() {
  return static_cast<std::uint64_t>(std::max(::sysconf(_SC_PAGESIZE), 0L));
}

std::uint64_t address_space_left() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return kNoLimit;
  std::uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return limit.rlim_cur - std::min<std::uint64_t>(limit.rlim_cur, pages * page_bytes());
}

thread_local int large_works = 0;

// std::new_handler is the process's, and so is what it has to give.
std::atomic<void*> reserve{nullptr};
std::size_t reserve_bytes = 0;
std::atomic<bool> given{false};

void* take_reserve() {
  void* const taken = ::mmap(nullptr, reserve_bytes, PROT_READ | PROT_WRITE,
                             MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  return taken == MAP_FAILED ? nullptr : taken;
}

// Called where an allocation failed; returns for another attempt.
void give_reserve() {
  if (large_works > 0) throw std::bad_alloc();
  void* const held = reserve.exchange(nullptr);
  if (held == nullptr) throw std::bad_alloc();
  given = true;
  ::munmap(held, reserve_bytes);
}

}  // namespace

std::uint64_t group_memory_limit(std::string_view groups, const std::string& root) {
  std::uint64_t least = kNoLimit;
  std::istringstream lines{std::string(groups)};
  for (std::string line; std::getline(lines, line);) {  // "0::/a/b", "7:memory,cpu:/a/b"
    const std::size_t first = line.find(':'), second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    std::string kinds = ",";
    kinds.append(line, first + 1, second - first - 1);
    kinds += ',';
    const std::string_view group = std::string_view(line).substr(second + 1);
    if (kinds == ",,")
      least = std::min(least, limit_up(root, group, "memory.max"));
    else if (kinds.find(",memory,") != std::string::npos)
      least = std::min(least, limit_up(root + "/memory", group, "memory.limit_in_bytes"));
  }
  return least;
}

std::uint64_t memory_limit_bytes() {
  const auto pages = static_cast<std::uint64_t>(std::max(::sysconf(_SC_PHYS_PAGES), 0L));
  std::ifstream in("/proc/self/cgroup");
  const std::string groups((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  return std::min({pages * page_bytes(), group_memory_limit(groups, "/sys/fs/cgroup"), address_space_left()});
}

LargeWork::LargeWork() {
  ++large_works;
}
LargeWork::~LargeWork() {
  --large_works;
}
bool LargeWork::here() {
  return large_works > 0;
}

SmallWork::SmallWork() : large_works_(std::exchange(large_works, 0)) {}
SmallWork::~SmallWork() {
  large_works = large_works_;
}

MemoryReserve::MemoryReserve(std::size_t bytes) {
  reserve_bytes = bytes;
  reserve = take_reserve();
  std::set_new_handler(&give_reserve);
}

MemoryReserve::~MemoryReserve() {
  std::set_new_handler(nullptr);
  if (void* const held = reserve.exchange(nullptr)) ::munmap(held, reserve_bytes);
}

bool MemoryReserve::refill() {
  if (reserve.load() == nullptr) reserve = take_reserve();
  return given.exchange(false);
}

Error out_of_memory(std::string_view what) {
  std::string text(what);
  text += ": out of memory";
  return resource_error(std::move(text));
}

}  // namespace candela
