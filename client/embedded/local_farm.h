// A master and its workers inside this process, speaking the same protocol as anywhere, over an in-process
// channel.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/job/bundle.h"

namespace grpc {
class Channel;
}

namespace candela::client {

class LocalFarm {
 public:
  // The master alone; it continues what is in its folder. `page`: HOST:PORT of its page; empty: none.
  static Result<std::unique_ptr<LocalFarm>> start(const std::filesystem::path& data_dir,
                                                  const std::string& page = {});
  ~LocalFarm();  // stops

  std::shared_ptr<grpc::Channel> channel();
  int page_port() const;  // 0: no page
  // The token with which a browser reads the page.
  Result<std::string> page_token() const;
  // Stores a file of the scene without a call, which would copy and hash it once more at either end.
  Result<void> take(const bundle::File& file, const std::filesystem::path& path);
  // One worker for each entry, of so many threads. They share `texture_memory_bytes` and
  // `scene_memory_bytes` (0: the defaults).
  Result<void> start_workers(const std::vector<unsigned>& threads, const std::filesystem::path& cache_dir,
                             std::uint64_t texture_memory_bytes, std::uint64_t scene_memory_bytes);
  // Why no worker is left, if none is.
  std::optional<Error> workers_lost() const;
  // Workers finish or hand back what they have. Idempotent.
  void drain_workers();
  // Drains, and closes the master with a last checkpoint. Idempotent.
  void stop();

 private:
  struct State;
  explicit LocalFarm(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

// The value of --threads; without one a thread for each core.
Result<unsigned> parse_threads(const std::optional<std::string>& text);
// `total` threads over `workers` workers, as evenly as can be, at least one each.
std::vector<unsigned> split_threads(unsigned total, unsigned workers);

}  // namespace candela::client
