// Worker::start: options checked, the channel made, the real renderer plugged in.
#include "worker/service/worker_service.h"

#include <fmt/format.h>
#include <grpcpp/grpcpp.h>

#include <cmath>

#include "common/base/text.h"
#include "common/base/version.h"
#include "common/wire/wire.h"
#include "worker/service/farm_worker.h"

namespace candela::worker {
namespace {

constexpr int kMaxReceiveBytes = 64 << 20;  // a bundle of the largest size allowed is within
constexpr unsigned kMaxThreads = 4096;

Result<std::shared_ptr<grpc::Channel>> dial(const WorkerOptions& options) {
  CANDELA_ASSIGN(const wire::Address address, wire::parse_address(options.master, "--master"));
  CANDELA_ASSIGN(const std::shared_ptr<grpc::ChannelCredentials> credentials,
                 wire::channel_credentials(address, {options.tls_cert, options.tls_key, options.tls_ca},
                                           options.insecure));
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(kMaxReceiveBytes);
  // A farm is reached directly: a proxy meant for web pages is in its way.
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  // A master whose machine is gone answers nothing, not even with a closed connection.
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 20000);
  // The answer to a ping may wait behind what a slow link has to carry.
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 60000);
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 200);
  // Also the time one attempt to connect may take: TCP, TLS and HTTP/2 are four round trips.
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 20000);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 2000);
  return grpc::CreateCustomChannel(address.text(), credentials, arguments);
}

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
    CANDELA_ASSIGN(channel, dial(options));
  }
  const scene::TextureLimits textures = {
      options.texture_memory_bytes, options.scratch_dir.empty() ? options.cache_dir : options.scratch_dir};
  const auto create = [textures](const description::FileSource& files, const std::string& main_key,
                                 const std::map<std::string, std::string>& parameters,
                                 const JobSettings& settings, unsigned threads) {
    return render::Renderer::create(files, main_key, parameters, settings, threads, textures);
  };
  return FarmWorker::start(options, std::move(channel), {create, &render::supported_isas});
}

}  // namespace candela::worker
