// Bytes that are written once, front to back, and then read for a scene's life: decoded texels. Up to a
// budget they lie in anonymous memory; what comes beyond it lies in one file without a name, mapped for
// reading, so that the kernel's page cache holds what is in use and drops the rest. A lookup is a load from
// memory either way: no locks, no eviction policy of our own, the same bits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <utility>

#include "common/base/result.h"

namespace candela::scene {

std::uint64_t default_texture_memory_bytes();  // a quarter of the machine's memory

struct TextureLimits {
  std::uint64_t memory_bytes = 0;        // of anonymous memory; 0: the default
  std::filesystem::path scratch_folder;  // on a disk, not in memory; empty: $TMPDIR, else /var/tmp
};

// Written bytes; they begin at a page of memory.
class ScratchBlock {
 public:
  ScratchBlock() = default;
  ScratchBlock(ScratchBlock&& other) noexcept
      : data_(std::exchange(other.data_, nullptr)), size_(std::exchange(other.size_, 0)) {}
  ScratchBlock& operator=(ScratchBlock&& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    return *this;
  }
  ~ScratchBlock();
  const std::byte* data() const { return data_; }
  std::size_t size() const { return size_; }

 private:
  friend class Scratch;
  ScratchBlock(std::byte* data, std::size_t size) : data_(data), size_(size) {}
  std::byte* data_ = nullptr;
  std::size_t size_ = 0;
};

// Not for use by several threads at once; its blocks may be, and may outlive it.
class Scratch {
 public:
  explicit Scratch(TextureLimits limits);
  ~Scratch();
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

  // One block in the making. Bytes of the file are written, never faulted in, so that a full disk is an error
  // here and not a signal at some lookup.
  class Writer {
   public:
    Result<void> append(std::span<const std::byte> bytes);
    Result<ScratchBlock> finish();  // once `size` bytes are in

   private:
    friend class Scratch;
    Scratch* scratch_ = nullptr;
    ScratchBlock memory_;  // empty: into the file
    std::uint64_t offset_ = 0;
    std::uint64_t size_ = 0, written_ = 0;
  };
  // The Scratch must outlive the writer. One writer at a time.
  Result<Writer> begin(std::uint64_t size);

  std::uint64_t memory_bytes() const { return memory_bytes_; }
  std::uint64_t file_bytes() const { return file_bytes_; }

 private:
  Result<void> open_file();

  TextureLimits limits_;
  std::uint64_t memory_bytes_ = 0, file_bytes_ = 0;
  int file_ = -1;
};

}  // namespace candela::scene
