// Worker::start: options checked, the channel made, the real renderer plugged in.
#include "worker/service/worker_service.h"

#include <fmt/format.h>

#include <cmath>

#include "common/base/text.h"
#include "common/wire/dial.h"
#include "worker/service/farm_worker.h"

namespace candela::worker {
namespace {

constexpr unsigned kMaxThreads = 4096;

}  // namespace

Result<std::unique_ptr<Worker>> Worker::start(const WorkerOptions& options,
                                              std::shared_ptr<grpc::Channel> channel) {
  if (options.cache_dir.empty()) return usage_error("no folder is given").with_field("--cache");
  if (options.threads > kMaxThreads)
    return usage_error("more threads than any machine has").with_field("--threads");
  if (!std::isfinite(options.give_up_seconds) || options.give_up_seconds < 0)
    return usage_error("not a number of seconds of at least 0").with_field("--give-up");
  if (options.name.size() > Limits::max_name_bytes)
    return usage_error("the name is longer than 256 bytes").with_field("--name");
  if (!is_utf8(options.name))
    return usage_error(fmt::format("'{}' is not text in UTF-8", options.name)).with_field("--name");
  if (channel == nullptr) {
    CANDELA_ASSIGN(channel, wire::dial({.master = options.master,
                                        .tls = {options.tls_cert, options.tls_key, options.tls_ca},
                                        .role = wire::Role::worker,
                                        .token_file = options.token_file,
                                        .insecure = options.insecure}));
  }
  const scene::TextureLimits textures = {
      options.texture_memory_bytes, options.scratch_dir.empty() ? options.cache_dir : options.scratch_dir};
  const std::uint64_t memory = options.reading_memory_bytes;
  const auto create = [textures, memory](const description::FileSource& files, const std::string& main_key,
                                         const std::map<std::string, std::string>& parameters,
                                         const JobSettings& settings, unsigned threads) {
    return render::Renderer::create(files, main_key, parameters, settings, threads, textures, memory);
  };
  return FarmWorker::start(options, std::move(channel), {create, &render::supported_isas});
}

}  // namespace candela::worker
