// The memory that reading a scene may take: readers ask for it before they take it.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"

namespace candela::description {

// May be used by several threads.
class ReadingBudget {
 public:
  // 0: default_bytes().
  explicit ReadingBudget(std::uint64_t limit_bytes)
      : limit_(limit_bytes > 0 ? limit_bytes : default_bytes()) {}
  // A part of another budget, which outlives it: what is counted here counts there, until this is destroyed
  // or keep() is called.
  struct PartOf {
    ReadingBudget& whole;
  };
  explicit ReadingBudget(PartOf part) : limit_(part.whole.limit_), whole_(&part.whole) {}
  ~ReadingBudget() {
    if (whole_ != nullptr) whole_->give_back(used());
  }
  ReadingBudget(const ReadingBudget&) = delete;
  ReadingBudget& operator=(const ReadingBudget&) = delete;

  // Half of the memory that this process may have: of the machine's, or of a smaller limit of its cgroup.
  static std::uint64_t default_bytes();
  // Counts nothing.
  static ReadingBudget& unlimited();

  // Counts the bytes; false, and counts nothing, if they do not fit.
  [[nodiscard]] bool take(std::uint64_t bytes) {
    if (limit_ == kUnlimited) return true;
    if (whole_ != nullptr && !whole_->take(bytes)) return false;
    const std::uint64_t before = used_.fetch_add(bytes, std::memory_order_relaxed);
    if (before <= limit_ && bytes <= limit_ - before) return true;
    used_.fetch_sub(bytes, std::memory_order_relaxed);
    return false;
  }
  void give_back(std::uint64_t bytes) {
    if (limit_ == kUnlimited) return;
    used_.fetch_sub(bytes, std::memory_order_relaxed);
    if (whole_ != nullptr) whole_->give_back(bytes);
  }
  // Leaves the bytes of this part counted in the whole.
  void keep() { whole_ = nullptr; }

  std::uint64_t used() const { return used_.load(std::memory_order_relaxed); }
  std::uint64_t limit() const { return limit_; }
  std::uint64_t left() const {
    return whole_ != nullptr ? whole_->left() : limit_ - std::min(limit_, used());
  }

  // The error after a take() that failed: of the scene, not of the machine, so that a farm does not try the
  // scene on one worker after the other. `what` the bytes are for: "instances"; 0: nobody knows how many.
  Error refusal(const Location& where, std::string_view what, std::uint64_t bytes) const;
  // True once charge() or refusal() has failed. The reader stops then.
  bool refused() const { return refused_; }
  Result<void> charge(std::uint64_t bytes, const Location& where, std::string_view what) {
    if (take(bytes)) return {};
    return refusal(where, what, bytes);
  }

 private:
  static constexpr std::uint64_t kUnlimited = UINT64_MAX;

  std::uint64_t limit_;
  std::atomic<std::uint64_t> used_ = 0;
  mutable std::atomic<bool> refused_ = false;
  ReadingBudget* whole_ = nullptr;
};

// Bytes of a budget, given back with the memory that they stand for. The budget must outlive it.
class Charge {
 public:
  Charge() = default;
  explicit Charge(ReadingBudget& budget) : budget_(&budget) {}
  Charge(Charge&& other) noexcept : budget_(other.budget_), bytes_(std::exchange(other.bytes_, 0)) {}
  Charge& operator=(Charge&& other) noexcept {
    std::swap(budget_, other.budget_);
    std::swap(bytes_, other.bytes_);
    return *this;
  }
  ~Charge() { give_back(bytes_); }

  [[nodiscard]] bool take(std::uint64_t bytes) {
    if (budget_ == nullptr) return true;
    if (!budget_->take(bytes)) return false;
    bytes_ += bytes;
    return true;
  }
  Result<void> add(std::uint64_t bytes, const Location& where, std::string_view what) {
    if (take(bytes)) return {};
    return budget_->refusal(where, what, bytes);
  }
  void give_back(std::uint64_t bytes) {
    if (budget_ == nullptr || bytes == 0) return;
    budget_->give_back(bytes);
    bytes_ -= bytes;
  }
  // The bytes stay counted.
  void keep() { bytes_ = 0; }

 private:
  ReadingBudget* budget_ = nullptr;
  std::uint64_t bytes_ = 0;
};

// Makes room for one more element: asks for a buffer of twice the size if there is none.
template <class T>
Result<void> make_room(std::vector<T>& list, ReadingBudget& budget, const Location& where,
                       std::string_view what) {
  if (list.size() < list.capacity()) return {};
  const std::size_t before = list.capacity(), after = before < 2 ? before + 1 : 2 * before;
  if (!budget.take(after * sizeof(T))) return budget.refusal(where, what, after * sizeof(T));
  list.reserve(after);
  budget.give_back(before * sizeof(T));
  return {};
}

// The files of another source, read within a budget. Both must outlive this.
class BudgetedFiles final : public FileSource {
 public:
  BudgetedFiles(const FileSource& files, ReadingBudget& budget) : files_(files), budget_(budget) {}
  Result<Bytes> open(const std::string& key) const override { return files_.open(key); }
  Result<Bytes> start(const std::string& key, std::size_t count) const override {
    return files_.start(key, count);
  }
  Result<void> find(const std::string& key) const override { return files_.find(key); }
  ReadingBudget& budget() const override { return budget_; }

 private:
  const FileSource& files_;
  ReadingBudget& budget_;
};

// Bytes that a string has on the heap.
inline std::uint64_t heap_bytes(const std::string& text) {
  constexpr std::size_t kInPlace = 15;  // characters that libstdc++ keeps in the string
  return text.capacity() > kInPlace ? text.capacity() + 17 : 0;
}
inline std::uint64_t heap_bytes(const Location& where) {
  return heap_bytes(where.file);
}
std::uint64_t memory_of(const Property& property);
// An object with its properties and its list of children, without the children.
std::uint64_t memory_of(const Object& object);

}  // namespace candela::description
