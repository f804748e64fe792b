// A vector of plain values that needs no memory of its own up to N of them: what follows from a path is made
// anew for each proposal of a chain, and few paths have more vertices.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <type_traits>
#include <utility>
#include <vector>

namespace candela {

template <class T, std::size_t N>
class InlineVector {
  static_assert(std::is_trivially_copyable_v<T> && !std::is_same_v<T, bool>);

 public:
  InlineVector() {}  // NOLINT(modernize-use-equals-default): the values within stay as they are
  InlineVector(const InlineVector& other) { copy(other); }
  InlineVector(InlineVector&& other) noexcept : size_(other.size_), more_(std::move(other.more_)) {
    if (size_ <= N) std::copy_n(other.within(), size_, within());
  }
  InlineVector& operator=(const InlineVector& other) {
    if (this != &other) copy(other);
    return *this;
  }
  InlineVector& operator=(InlineVector&& other) noexcept {
    size_ = other.size_;
    more_ = std::move(other.more_);
    if (size_ <= N) std::copy_n(other.within(), size_, within());
    return *this;
  }
  ~InlineVector() = default;

  void assign(std::size_t count, const T& value) {
    set_size(count);
    std::fill_n(data(), count, value);
  }
  // Values that are there stay; new ones are T().
  void resize(std::size_t count) {
    const std::size_t before = size_;
    if (count > N && before <= N) more_.assign(within(), within() + before);
    if (count > N)
      more_.resize(count);
    else if (before > N)
      std::copy_n(more_.data(), count, within());
    size_ = count;
    for (std::size_t i = before; i < count; ++i) data()[i] = T();
  }
  void push_back(const T& value) {
    if (size_ < N) {
      within()[size_++] = value;
      return;
    }
    const T copied = value;
    resize(size_ + 1);
    back() = copied;
  }

  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  T* data() { return size_ > N ? more_.data() : within(); }
  const T* data() const { return size_ > N ? more_.data() : within(); }
  T& operator[](std::size_t i) { return data()[i]; }
  const T& operator[](std::size_t i) const { return data()[i]; }
  T& front() { return data()[0]; }
  const T& front() const { return data()[0]; }
  T& back() { return data()[size_ - 1]; }
  const T& back() const { return data()[size_ - 1]; }
  T* begin() { return data(); }
  const T* begin() const { return data(); }
  T* end() { return data() + size_; }
  const T* end() const { return data() + size_; }
  friend bool operator==(const InlineVector& a, const InlineVector& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end());
  }

 private:
  // Storage without a constructor: only the first size_ values are ever read.
  union Storage {
    Storage() {}   // NOLINT(modernize-use-equals-default)
    ~Storage() {}  // NOLINT(modernize-use-equals-default)
    std::array<T, N> values;
  };
  T* within() { return storage_.values.data(); }
  const T* within() const { return storage_.values.data(); }
  void set_size(std::size_t count) {
    if (count > N) more_.resize(count);
    size_ = count;
  }
  void copy(const InlineVector& other) {
    set_size(other.size_);
    std::copy_n(other.data(), size_, data());
  }

  std::size_t size_ = 0;
  Storage storage_;
  std::vector<T> more_;
};

}  // namespace candela
