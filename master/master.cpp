// The master's outside: the gRPC server over a Farm, and its orderly end.
#include "master/master.h"

#include <fmt/format.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/resource_quota.h>

#include <chrono>
#include <cmath>

#include "common/base/files.h"
#include "common/base/log.h"
#include "common/base/mutex.h"
#include "common/base/text.h"
#include "common/wire/token.h"
#include "common/wire/wire.h"
#include "master/api/guarded_services.h"
#include "master/farm.h"
#include "master/http/http_server.h"
#include "master/http/live_page.h"
#include "master/http/notices.h"

namespace candela::master {
namespace {

constexpr int kMaxMessageBytes = 8 << 20;
constexpr int kMaxThreads = 1024;            // each streaming call holds one
constexpr const char* kTokenFile = "token";  // in the data folder
constexpr const char* kNotifySecretFile = "notify-secret";
constexpr auto kShutdownGrace = std::chrono::seconds(2);

Result<void> check(const MasterOptions& o) {
  const auto positive = [](double value, double largest, const char* option) -> Result<void> {
    if (std::isfinite(value) && value > 0 && value <= largest) return {};
    return usage_error(fmt::format("must be seconds, above 0 and at most {}", largest)).with_field(option);
  };
  CANDELA_TRY(positive(o.checkpoint_seconds, 86400, "--checkpoint-interval"));
  CANDELA_TRY(positive(o.lease_seconds, 86400, "--lease-time"));
  CANDELA_TRY(positive(o.unit_seconds, 86400, "--unit-time"));
  CANDELA_TRY(positive(o.stuck_seconds, 1e6, "--stuck-after"));
  if (o.merge_queue_bytes < (1 << 20))
    return usage_error("must be at least 1 MiB").with_field("--merge-queue");
  if (o.merge_threads == 0 || o.merge_threads > 256)
    return usage_error("must be 1 to 256").with_field("merge_threads");
  return {};
}

class MasterImpl final : public Master {
 public:
  // `own_token`: of the calls of this process.
  MasterImpl(std::unique_ptr<Notices> notices, std::unique_ptr<Farm> farm, std::string own_token,
             std::string token, bool tls)
      : notices_(std::move(notices)),
        farm_(std::move(farm)),
        access_(tls ? Access(own_token) : Access(own_token, token, farm_->data_folder() / kTokenFile)),
        own_token_(std::move(own_token)),
        token_(std::move(token)),
        farm_service_(*farm_, access_),
        worker_service_(*farm_, access_) {}
  ~MasterImpl() override { stop(); }

  Result<void> serve(const MasterOptions& o, const std::shared_ptr<grpc::ServerCredentials>& credentials) {
    grpc::ServerBuilder builder;
    wire::Address address;
    if (!o.listen.empty()) {
      CANDELA_ASSIGN(address, wire::parse_address(o.listen, "--listen"));
      builder.AddListeningPort(address.text(), credentials, &port_);
    }
    builder.RegisterService(&farm_service_);
    builder.RegisterService(&worker_service_);
    builder.SetMaxReceiveMessageSize(kMaxMessageBytes);
    builder.SetMaxSendMessageSize(kMaxMessageBytes);
    // Two masters on one port would each get some of the calls; the second must fail instead.
    builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
    builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, 30000);
    // An answer to a ping waits behind what a slow link has to carry: 64 KiB and more.
    builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 60000);
    // Pings measure slow links and are no attack: no number of them ends a connection.
    builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PING_STRIKES, 0);
    // A connection that does not get as far as a call. Over the slowest link TLS takes a few seconds.
    builder.AddChannelArgument(GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS, 30000);
    builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, 5000);
    builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
    grpc::ResourceQuota quota("candela-master");
    quota.SetMaxThreads(kMaxThreads);
    builder.SetResourceQuota(quota);
    builder.SetSyncServerOption(grpc::ServerBuilder::SyncServerOption::MAX_POLLERS, 4);
    server_ = builder.BuildAndStart();
    if (!server_ || (!o.listen.empty() && port_ == 0))
      return usage_error(fmt::format("cannot listen on {}", o.listen))
          .with_field("--listen")
          .with_mend("choose another address or port, or stop what holds it");
    const bool any_port = address.port == 0;
    address.port = port_;
    if (port_ != 0 && o.tls_cert.empty()) tell_token(o, address, any_port);
    access_.open();
    if (notices_) notices_->start(farm_.get());
    if (!o.http_listen.empty()) {
      std::string token;
      if (!o.page_token_file.empty()) {
        CANDELA_ASSIGN(token, read_page_token(o.page_token_file));
      }
      CANDELA_ASSIGN(http_, HttpServer::start(*farm_, o.http_listen, token, token_));
    }
    return {};
  }

  int port() const override { return port_; }
  int http_port() const override { return http_ ? http_->port() : 0; }
  std::shared_ptr<grpc::Channel> in_process_channel() override {
    grpc::ChannelArguments arguments;
    arguments.SetMaxReceiveMessageSize(kMaxMessageBytes);
    arguments.SetMaxSendMessageSize(kMaxMessageBytes);
    return server_->experimental().InProcessChannelWithInterceptors(arguments,
                                                                    wire::token_interceptors(own_token_));
  }
  std::filesystem::path blob_file(const std::string& sha256) const override {
    return farm_->blobs().path(sha256);
  }
  Result<void> take_blob(const std::string& sha256, std::uint64_t size_bytes,
                         const std::filesystem::path& file) override {
    CANDELA_TRY(farm_->blobs().take(sha256, size_bytes, file));
    farm_->blob_found(sha256);
    return {};
  }
  void flush_images() override { farm_->flush_images(); }

  void stop() override {
    const Lock lock(stop_mutex_);
    farm_->begin_stop();
    if (server_) {
      server_->Shutdown(std::chrono::system_clock::now() + kShutdownGrace);
      server_->Wait();
    }
    http_.reset();
    farm_->stop();
    if (notices_) notices_->stop();
    if (std::error_code ignored; !passing_token_file_.empty())
      std::filesystem::remove(passing_token_file_, ignored);
  }

 private:
  void tell_token(const MasterOptions& o, const wire::Address& address, bool any_port) {
    const std::string file = (farm_->data_folder() / kTokenFile).string();
    const auto published = o.publish_token ? wire::published_token_file(address) : std::nullopt;
    Result<void> written;
    if (published) written = wire::publish_token(token_, *published);
    // A port that the system chose is not used again.
    if (published && written.ok() && any_port) passing_token_file_ = *published;
    if (published && written.ok())
      return log::info(
          fmt::format("calls must carry the token of '{}'; programs of this user find it in '{}'", file,
                      published->string()));
    log::info(fmt::format("calls must carry the token of '{}': give it to programs with --token-file{}", file,
                          written.ok() ? "" : ", for " + written.error().to_string()));
  }

  std::unique_ptr<Notices> notices_;  // null: none are sent; the farm tells it of changes
  std::unique_ptr<Farm> farm_;
  Access access_;
  const std::string own_token_;
  const std::string token_;  // of calls without TLS, and of who reads the page
  std::filesystem::path passing_token_file_;
  GuardedFarmService farm_service_;
  GuardedWorkerService worker_service_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<HttpServer> http_;
  int port_ = 0;
  Mutex stop_mutex_;
};

// Null: none are sent.
Result<std::unique_ptr<Notices>> make_notices(const MasterOptions& o) {
  if (o.notify.empty() && !o.notify_secret_file.empty())
    return usage_error("a secret signs notices, and there are none")
        .with_field("--notify-secret-file")
        .with_mend("say where notices go: --notify URL");
  if (o.notify.empty()) return std::unique_ptr<Notices>();
  CANDELA_ASSIGN(const Poster* const poster, load_poster());
  const Poster::Target target = poster->check(o.notify);
  if (!target.error.empty())
    return usage_error(fmt::format("'{}': {}", escape_unprintable(o.notify), target.error))
        .with_field("--notify")
        .with_mend("such as https://render.example.org/notices");
  if (target.in_clear)
    log::warn("--notify sends names of jobs and workers to another machine in clear: use https://");
  NoticeOptions options{.url = o.notify, .secret = {}};
  if (o.notify_secret_file.empty()) {
    CANDELA_TRY(make_directories(o.data_dir));
    CANDELA_ASSIGN(options.secret, wire::make_token_file(o.data_dir / kNotifySecretFile));
  } else {
    auto secret = wire::read_token_file(o.notify_secret_file);
    if (!secret.ok()) {
      Error error = std::move(secret).error();
      error.kind = ErrorKind::usage;
      return std::move(error).with_field("--notify-secret-file");
    }
    options.secret = std::move(*secret);
  }
  return std::make_unique<Notices>(std::move(options), *poster);
}

}  // namespace

Result<std::unique_ptr<Master>> Master::start(const MasterOptions& options) {
  CANDELA_TRY(check(options));
  std::shared_ptr<grpc::ServerCredentials> credentials;
  const wire::TlsFiles tls{options.tls_cert, options.tls_key, options.tls_ca};
  if (!options.listen.empty()) {  // before the store is touched
    CANDELA_ASSIGN(const wire::Address address, wire::parse_address(options.listen, "--listen"));
    CANDELA_ASSIGN(credentials, wire::server_credentials(address, tls, options.insecure));
  }
  if (!options.http_listen.empty()) {
    CANDELA_ASSIGN(const wire::Address http, wire::parse_address(options.http_listen, "--http"));
    if (!http.loopback && !options.insecure)
      return usage_error("the page, health and metrics are plain HTTP, and " + http.text() +
                         " can be reached from elsewhere")
          .with_field("--http")
          .with_mend("listen on 127.0.0.1 and let a proxy of yours serve it, or say --insecure");
  }
  if (!options.page_token_file.empty()) {
    if (options.http_listen.empty())
      return usage_error("a token is for the page, and there is none")
          .with_field("--page-token-file")
          .with_mend("say where to serve the page: --http HOST:PORT");
    CANDELA_TRY(read_page_token(options.page_token_file));
  }
  CANDELA_ASSIGN(std::unique_ptr<Notices> notices, make_notices(options));
  FarmOptions farm_options;
  farm_options.master = options;
  if (notices)
    farm_options.listener = [n = notices.get()](const Scheduler& s, std::span<const Change> changes) {
      n->tell(notices_of(s, changes, JobTable::now()));
    };
  CANDELA_ASSIGN(std::unique_ptr<Farm> farm, Farm::open(farm_options));
  CANDELA_ASSIGN(std::string token, wire::make_token_file(options.data_dir / kTokenFile));
  CANDELA_ASSIGN(std::string own_token, wire::random_token());
  auto master = std::make_unique<MasterImpl>(std::move(notices), std::move(farm), std::move(own_token),
                                             std::move(token), tls.any());
  CANDELA_TRY(master->serve(options, credentials));
  return std::unique_ptr<Master>(std::move(master));
}

}  // namespace candela::master
