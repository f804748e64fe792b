#include "client/worker_choice.h"

#include <fmt/format.h>

#include "client/values.h"

namespace candela::client {

Result<std::string> choose_worker(const v1::ListWorkersResponse& workers, const std::string& word) {
  std::string ids;
  std::size_t named = 0;
  std::string chosen = word;
  for (const auto& worker : workers.workers()) {
    if (worker.id() == word) return word;
    if (worker.name() != word || worker.state() == "lost" || worker.state() == "drained") continue;
    ids += (named++ == 0 ? "" : ", ") + worker.id();
    chosen = worker.id();
  }
  if (named > 1)
    return usage_error(fmt::format("{} workers are named '{}': {}", named, printable(word), printable(ids)))
        .with_field("worker")
        .with_mend("give one of these ids");
  return chosen;
}

}  // namespace candela::client
