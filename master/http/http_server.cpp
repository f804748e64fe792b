#include "master/http/http_server.h"

#include <CivetServer.h>
#include <fmt/format.h>

#include <algorithm>

#include "common/wire/wire.h"
#include "master/farm.h"

namespace candela::master {
namespace {

void answer(mg_connection* connection, int code, const char* reason, const char* type,
            const std::string& body) {
  mg_printf(connection,
            "HTTP/1.1 %d %s\r\nContent-Type: %s\r\nContent-Length: %zu\r\nCache-Control: no-store\r\n"
            "Connection: close\r\n\r\n",
            code, reason, type, body.size());
  mg_write(connection, body.data(), body.size());
}

class HealthHandler final : public CivetHandler {
 public:
  explicit HealthHandler(Farm& farm) : farm_(farm) {}
  bool handleGet(CivetServer*, mg_connection* connection) override {
    const std::string trouble = farm_.stopping() ? "stopping" : farm_.trouble();
    if (trouble.empty())
      answer(connection, 200, "OK", "text/plain; charset=utf-8", "ok\n");
    else
      answer(connection, 503, "Service Unavailable", "text/plain; charset=utf-8", trouble + "\n");
    return true;
  }

 private:
  Farm& farm_;
};

class MetricsHandler final : public CivetHandler {
 public:
  explicit MetricsHandler(Farm& farm) : farm_(farm) {}
  bool handleGet(CivetServer*, mg_connection* connection) override {
    answer(connection, 200, "OK", "text/plain; version=0.0.4; charset=utf-8", metrics_text(farm_));
    return true;
  }

 private:
  Farm& farm_;
};

class Server final : public HttpServer {
 public:
  Server(Farm& farm, const std::vector<std::string>& options)
      : health_(farm), metrics_(farm), server_(options) {
    server_.addHandler("/healthz", health_);
    server_.addHandler("/metrics", metrics_);
  }
  int port() const override {
    const std::vector<int> ports = const_cast<CivetServer&>(server_).getListeningPorts();
    return ports.empty() ? 0 : ports.front();
  }

 private:
  HealthHandler health_;
  MetricsHandler metrics_;
  CivetServer server_;
};

}  // namespace

Result<std::unique_ptr<HttpServer>> HttpServer::start(Farm& farm, const std::string& listen) {
  CANDELA_ASSIGN(const wire::Address address, wire::parse_address(listen, "--http"));
  const bool v6 = std::count(address.host.begin(), address.host.end(), ':') > 0;
  const std::string host = address.host == "localhost" ? "127.0.0.1"
                           : v6                        ? "[" + address.host + "]"
                                                       : address.host;
  const std::vector<std::string> options = {"listening_ports",    fmt::format("{}:{}", host, address.port),
                                            "num_threads",        "4",
                                            "request_timeout_ms", "5000",
                                            "enable_keep_alive",  "no"};
  try {
    return std::unique_ptr<HttpServer>(std::make_unique<Server>(farm, options));
  } catch (const std::exception& e) {
    return usage_error(fmt::format("cannot listen on {}: {}", address.text(), e.what()))
        .with_field("--http")
        .with_mend("choose another port, or stop what holds it");
  }
}

}  // namespace candela::master
