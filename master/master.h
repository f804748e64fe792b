// The master as a library: candela-master runs one, `candela render` runs one inside its process.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "common/base/result.h"
#include "master/options.h"

namespace grpc {
class Channel;
}

namespace candela::master {

class Master {
 public:
  virtual ~Master() = default;  // stops if running, with a last checkpoint of every job
  // Opens the store (continuing every job in it), binds and serves. Errors name the option and the mend.
  static Result<std::unique_ptr<Master>> start(const MasterOptions& options);

  virtual int port() const = 0;       // 0: in-process only
  virtual int http_port() const = 0;  // 0: none
  virtual std::shared_ptr<grpc::Channel> in_process_channel() = 0;
  // The file that holds a blob, if the store has it: for a worker of this process. Precondition:
  // is_sha256_hex(sha256).
  virtual std::filesystem::path blob_file(const std::string& sha256) const = 0;
  // Stores a file of this machine as a blob: for a client of this process. The same precondition.
  virtual Result<void> take_blob(const std::string& sha256, std::uint64_t size_bytes,
                                 const std::filesystem::path& file) = 0;
  virtual void flush_images() = 0;  // write every running job's checkpoint and image now
  virtual void stop() = 0;          // idempotent; returns when the last checkpoint is on disk
};

}  // namespace candela::master
