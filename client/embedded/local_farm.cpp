#include "client/embedded/local_farm.h"

#include <fmt/format.h>
#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <thread>

#include "client/values.h"
#include "common/base/memory_limit.h"
#include "common/base/mutex.h"
#include "common/description/reading_budget.h"
#include "common/wire/token.h"
#include "master/master.h"
#include "worker/scene/textures/scratch.h"
#include "worker/service/worker_service.h"

namespace candela::client {

struct LocalFarm::State {
  std::filesystem::path data_dir;
  std::unique_ptr<master::Master> master;
  std::vector<std::unique_ptr<worker::Worker>> workers;
  std::vector<std::thread> waiters;  // one for each worker, to hear of its end
  mutable Mutex mutex;
  std::size_t alive CANDELA_GUARDED_BY(mutex) = 0;
  bool draining CANDELA_GUARDED_BY(mutex) = false;
  std::optional<Error> lost CANDELA_GUARDED_BY(mutex);
};

LocalFarm::LocalFarm(std::unique_ptr<State> state) : state_(std::move(state)) {}
LocalFarm::~LocalFarm() {
  stop();
}

Result<std::unique_ptr<LocalFarm>> LocalFarm::start(const std::filesystem::path& data_dir,
                                                    const std::string& page) {
  master::MasterOptions options;
  options.data_dir = data_dir;
  options.listen.clear();
  options.http_listen = page;
  // One job, which may well be larger than what a farm should take: the system can swap.
  options.memory_bytes = 2 * memory_limit_bytes();
  options.statistics_bytes = options.memory_bytes / 8;
  options.image_on_checkpoint = false;  // we write the image ourselves, where it was asked for
  auto state = std::make_unique<State>();
  state->data_dir = data_dir;
  auto master = master::Master::start(options);
  if (!master.ok() && master.error().field == "--http")
    return std::move(master).error().with_field("--page").with_mend(
        "use a free port of this machine, such as localhost:9090; port 0 picks one");
  CANDELA_ASSIGN(state->master, std::move(master));
  return std::unique_ptr<LocalFarm>(new LocalFarm(std::move(state)));
}

std::shared_ptr<grpc::Channel> LocalFarm::channel() {
  return state_->master->in_process_channel();
}

Result<std::string> LocalFarm::page_token() const {
  return wire::read_token_file(state_->data_dir / "token");
}

int LocalFarm::page_port() const {
  return state_->master->http_port();
}

Result<void> LocalFarm::take(const bundle::File& file, const std::filesystem::path& path) {
  return state_->master->take_blob(file.sha256, file.size_bytes, path);
}

Result<void> LocalFarm::start_workers(const std::vector<unsigned>& threads,
                                      const std::filesystem::path& cache_dir,
                                      std::uint64_t texture_memory_bytes, std::uint64_t scene_memory_bytes) {
  State& state = *state_;
  if (texture_memory_bytes == 0) texture_memory_bytes = scene::default_texture_memory_bytes();
  if (scene_memory_bytes == 0) scene_memory_bytes = description::ReadingBudget::default_bytes();
  for (std::size_t i = 0; i < threads.size(); ++i) {
    worker::WorkerOptions options;
    options.reading_memory_bytes = std::max<std::uint64_t>(1, scene_memory_bytes / threads.size());
    options.cache_dir = cache_dir;
    options.blobs_beside = [&state](const std::string& sha256) { return state.master->blob_file(sha256); };
    options.threads = threads[i];
    options.texture_memory_bytes = std::max<std::uint64_t>(1, texture_memory_bytes / threads.size());
    options.name = fmt::format("local-{}", i + 1);
    CANDELA_ASSIGN(std::unique_ptr<worker::Worker> one, worker::Worker::start(options, channel()));
    {
      const Lock lock(state.mutex);
      ++state.alive;
    }
    worker::Worker* raw = one.get();
    state.workers.push_back(std::move(one));
    state.waiters.emplace_back([&state, raw] {
      auto ended = raw->wait();
      const Lock lock(state.mutex);
      --state.alive;
      if (state.draining) return;
      if (!ended.ok()) state.lost = std::move(ended).error();
      if (raw->must_begin_again() && !state.lost)
        state.lost = failed_error("the renderer does not stop, and only the end of this program ends it");
      if (state.alive == 0 && !state.lost)
        state.lost = internal_error("the workers of this process ended by themselves");
    });
  }
  return {};
}

std::optional<Error> LocalFarm::workers_lost() const {
  const Lock lock(state_->mutex);
  return state_->alive == 0 ? state_->lost : std::nullopt;
}

void LocalFarm::drain_workers() {
  {
    const Lock lock(state_->mutex);
    state_->draining = true;
  }
  std::vector<std::thread> drains;
  for (const auto& one : state_->workers) drains.emplace_back([&one] { one->drain(); });
  for (std::thread& drain : drains) drain.join();
  for (std::thread& waiter : state_->waiters) waiter.join();
  state_->waiters.clear();
  state_->workers.clear();
}

void LocalFarm::stop() {
  drain_workers();
  if (state_->master) state_->master->stop();
}

Result<unsigned> parse_threads(const std::optional<std::string>& text) {
  constexpr unsigned kMaxThreads = 1024;
  if (!text) return std::max(1U, std::thread::hardware_concurrency());
  CANDELA_ASSIGN(const std::uint64_t threads, parse_count(*text, "--threads", 1, kMaxThreads));
  return static_cast<unsigned>(threads);
}

std::vector<unsigned> split_threads(unsigned total, unsigned workers) {
  std::vector<unsigned> threads(workers, std::max(1U, total / workers));
  for (unsigned i = 0; total > workers && i < total % workers; ++i) ++threads[i];
  return threads;
}

}  // namespace candela::client
