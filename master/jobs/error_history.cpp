#include "master/jobs/error_history.h"

#include "common/base/files.h"

namespace candela::master {
namespace {

constexpr std::uint64_t kMaxFileBytes = 16 << 20;  // four images of 256 x 256 blocks, and more

std::filesystem::path file_in(const std::filesystem::path& job_folder) {
  return job_folder / "movement.bin";
}

}  // namespace

stats::Movement read_movement(const std::filesystem::path& job_folder) {
  auto bytes = read_file(file_in(job_folder), kMaxFileBytes);
  if (!bytes.ok()) return {};
  auto movement = stats::Movement::parse(*bytes);
  return movement.ok() ? std::move(*movement) : stats::Movement();
}

void write_movement(const std::filesystem::path& job_folder, const stats::Movement& movement) {
  std::error_code error;
  std::filesystem::create_directories(job_folder, error);
  static_cast<void>(write_file_atomically(file_in(job_folder), movement.serialise()));
}

}  // namespace candela::master
