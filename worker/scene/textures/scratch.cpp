#include "worker/scene/textures/scratch.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string>

namespace candela::scene {
namespace {

Error scratch_error(std::string what, const std::filesystem::path& folder, int code) {
  std::string message = std::move(what);
  message += " in '";
  message += folder.string();
  message += "': ";
  message += std::strerror(code);
  return resource_error(std::move(message))
      .with_mend("make room there, name another scratch folder, or allow textures more memory");
}

std::uint64_t page_size() {
  const long size = ::sysconf(_SC_PAGESIZE);
  return size > 0 ? static_cast<std::uint64_t>(size) : 4096;
}

}  // namespace

std::uint64_t default_texture_memory_bytes() {
  const long pages = ::sysconf(_SC_PHYS_PAGES);
  return pages > 0 ? static_cast<std::uint64_t>(pages) * page_size() / 4 : 1ull << 30;
}

ScratchBlock::~ScratchBlock() {
  if (data_ != nullptr) ::munmap(data_, size_);
}

Scratch::Scratch(TextureLimits limits) : limits_(std::move(limits)) {
  if (limits_.memory_bytes == 0) limits_.memory_bytes = default_texture_memory_bytes();
  if (limits_.scratch_folder.empty()) {
    const char* const folder = std::getenv("TMPDIR");
    limits_.scratch_folder = folder != nullptr && *folder != '\0' ? folder : "/var/tmp";
  }
}

Scratch::~Scratch() {
  if (file_ >= 0) ::close(file_);
}

Result<void> Scratch::open_file() {
  if (file_ >= 0) return {};
  const std::string folder = limits_.scratch_folder.string();
  file_ = ::open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
  if (file_ >= 0) return {};
  if (errno != EOPNOTSUPP && errno != EISDIR && errno != EINVAL)
    return scratch_error("cannot create a scratch file for textures", limits_.scratch_folder, errno);
  // A file system without nameless files (such as NFS): one whose name is gone at once.
  std::string name = folder + "/candela-textures-XXXXXX";
  file_ = ::mkostemp(name.data(), O_CLOEXEC);
  if (file_ < 0)
    return scratch_error("cannot create a scratch file for textures", limits_.scratch_folder, errno);
  ::unlink(name.c_str());
  return {};
}

Result<Scratch::Writer> Scratch::begin(std::uint64_t size) {
  Writer writer;
  writer.scratch_ = this;
  writer.size_ = size;
  if (size <= limits_.memory_bytes && memory_bytes_ <= limits_.memory_bytes - size) {
    void* const data = ::mmap(nullptr, std::max<std::uint64_t>(size, 1), PROT_READ | PROT_WRITE,
                              MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (data == MAP_FAILED) {
      return resource_error("there is no memory for " + std::to_string(size) + " bytes of texels")
          .with_mend("allow textures less memory, so that they go to the scratch folder");
    }
    // Lookups go all over a large image; where huge pages are to be had, they spare most page walks.
    ::madvise(data, size, MADV_HUGEPAGE);
    writer.memory_ = ScratchBlock(static_cast<std::byte*>(data), std::max<std::uint64_t>(size, 1));
    return writer;
  }
  CANDELA_TRY(open_file());
  writer.offset_ = file_bytes_;
  return writer;
}

Result<void> Scratch::Writer::append(std::span<const std::byte> bytes) {
  if (bytes.size() > size_ - written_) return internal_error("more texels than announced");
  if (memory_.data_ != nullptr) {
    if (!bytes.empty()) std::memcpy(memory_.data_ + written_, bytes.data(), bytes.size());
    written_ += bytes.size();
    return {};
  }
  while (!bytes.empty()) {
    const ssize_t n =
        ::pwrite(scratch_->file_, bytes.data(), bytes.size(), static_cast<off_t>(offset_ + written_));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) {
      return scratch_error("cannot write the scratch file of textures", scratch_->limits_.scratch_folder,
                           n < 0 ? errno : ENOSPC);
    }
    bytes = bytes.subspan(static_cast<std::size_t>(n));
    written_ += static_cast<std::uint64_t>(n);
  }
  return {};
}

Result<ScratchBlock> Scratch::Writer::finish() {
  if (written_ != size_) return internal_error("fewer texels than announced");
  if (memory_.data_ != nullptr) {
    scratch_->memory_bytes_ += size_;
    return std::move(memory_);
  }
  void* const data =
      ::mmap(nullptr, size_, PROT_READ, MAP_SHARED, scratch_->file_, static_cast<off_t>(offset_));
  if (data == MAP_FAILED)
    return scratch_error("cannot map the scratch file of textures", scratch_->limits_.scratch_folder, errno);
  // The next block begins at a page. (The end of the last page of a file reads as zeros.)
  const std::uint64_t page = page_size();
  scratch_->file_bytes_ = offset_ + (size_ + page - 1) / page * page;
  return ScratchBlock(static_cast<std::byte*>(data), size_);
}

}  // namespace candela::scene
