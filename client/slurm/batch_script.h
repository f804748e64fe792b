// The batch script of Slurm whose tasks are workers of a farm.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "client/farm_client.h"
#include "common/base/result.h"

namespace candela::client {

struct SlurmJob {
  std::uint32_t workers = 1;  // tasks of the array
  std::uint32_t cpus = 1;     // of each
  std::string memory;         // of each, such as "32G"; empty: the site's own
  std::string time;           // limit, as Slurm writes it, such as "8:00:00" or "2-0"; empty: the site's own
  std::uint32_t notice = 60;  // seconds of warning before the limit
  std::string partition, account, qos;
  std::string name = "candela-worker";
  std::string logs;               // folder; empty: where sbatch is called
  std::vector<std::string> more;  // further options of sbatch, such as "--constraint=avx2"
  std::string program = "candela-worker";
  std::string cache;    // folder on the node; empty: one of the user's in $TMPDIR or /tmp
  std::string give_up;  // how long a worker waits for a master that is gone; empty: for ever
  ConnectionOptions farm;
};

// Errors name the option of `candela slurm` that has a value Slurm or a shell would misread.
Result<std::string> batch_script(const SlurmJob& job);

// Hands the script to sbatch, which prints the job's number. Errors: there is no sbatch, or it refuses.
Result<void> submit_batch_script(const std::string& script);

}  // namespace candela::client
