#include "common/wire/dial.h"

#include <algorithm>

#include "common/wire/listener.h"
#include "common/wire/token.h"

namespace candela::wire {

Result<std::shared_ptr<grpc::Channel>> dial(const DialOptions& options) {
  CANDELA_ASSIGN(const Address address, parse_address(options.master, "--master"));
  CANDELA_ASSIGN(const std::shared_ptr<grpc::ChannelCredentials> credentials,
                 channel_credentials(address, options.tls, options.insecure, options.role));
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(options.max_receive_bytes);
  // A farm is reached directly: a proxy meant for web pages is in its way.
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  // A master whose machine is gone answers nothing, not even with a closed connection. The answer to a ping
  // may wait behind what a slow link has to carry.
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 20000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 60000);
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, options.min_backoff_ms);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, options.max_backoff_ms);
  // gRPC takes it also for the time limit of an attempt.
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, options.attempt_ms);
  if (options.tls.any()) return grpc::CreateCustomChannel(address.text(), credentials, arguments);
  std::filesystem::path token = options.token_file;
  if (!token.empty()) {
    if (auto read = read_token_file(token); !read.ok())
      return std::move(read).error().with_field("--token-file");
  } else {
    token = published_token_file(address).value_or("");
    // A file that is not there yet is the master's to make; one that cannot be used is told now.
    if (std::error_code code; std::filesystem::exists(token, code)) CANDELA_TRY(read_token_file(token));
    CANDELA_TRY(check_listener(address, token));
    return token_channel(address.text(), credentials, arguments, token, address);
  }
  return token_channel(address.text(), credentials, arguments, token);
}

}  // namespace candela::wire
