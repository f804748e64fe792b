// The store's part of a backup.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace candela::master {

// Copies the store in one transaction and checks the copy. The epoch of the copy is far ahead, so that no
// fencing token that the original gives from now on is given by who starts with the copy.
Result<void> copy_store(const std::filesystem::path& from, const std::filesystem::path& to);

// The ids of its jobs.
Result<std::vector<std::string>> jobs_of_store(const std::filesystem::path& store);

// Drops a job from a store that no master uses.
Result<void> drop_job(const std::filesystem::path& store, const std::string& job_id);

}  // namespace candela::master
