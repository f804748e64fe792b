// A copy of a data folder while its master works in it, or rests. docs/decisions/052-backup.md
//
// The store is copied first, in one transaction of SQLite; then the checkpoints of its jobs, which are at
// least as new; then the blobs. A master that starts with the copy finds films that have all that the store
// tells of, as after a crash. Checkpoints, manifests, images and blobs are replaced and never written again,
// so hard links to them are copies; what is appended to is copied.
#pragma once

#include <cstdint>
#include <filesystem>

#include "common/base/result.h"

namespace candela::master {

struct BackupOptions {
  std::filesystem::path data_dir;
  std::filesystem::path target;  // must not exist; it appears whole or not at all
  std::filesystem::path base;    // an earlier backup, whose files of equal bytes are linked; empty: none
};

struct BackupReport {
  std::uint64_t jobs = 0;
  std::uint64_t files = 0, bytes = 0;
  std::uint64_t linked_files = 0, linked_bytes = 0;  // of those
};

// Errors: usage for folders that cannot be meant, resource where the disk is full. Then there is no target,
// nor anything else of the attempt.
Result<BackupReport> back_up(const BackupOptions& options);

}  // namespace candela::master
