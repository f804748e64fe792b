#include "worker/loaders/parallel.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "common/base/work_monitor.h"

namespace candela::loaders {

std::size_t thread_count() {
  return static_cast<std::size_t>(tbb::this_task_arena::max_concurrency());
}

void for_all(std::size_t count, const std::function<void(std::size_t)>& body) {
  work_step();
  if (count == 1) return body(0);
  tbb::parallel_for(std::size_t{0}, count, [&body, monitor = watched_work()](std::size_t i) {
    const WatchedWork watch(monitor);
    work_step();
    body(i);
  });
}

void for_parts(std::size_t count,
               const std::function<void(std::size_t part, std::size_t begin, std::size_t end)>& body) {
  for_all((count + kGrain - 1) / kGrain,
          [&](std::size_t part) { body(part, part * kGrain, std::min(count, (part + 1) * kGrain)); });
}

}  // namespace candela::loaders
