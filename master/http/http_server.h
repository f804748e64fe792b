// The page, /healthz and /metrics over plain HTTP, on a thread of their own that no client can hold up.
#pragma once

#include <memory>
#include <string>

#include "common/base/result.h"

namespace candela::master {

class Farm;

class HttpServer {
 public:
  virtual ~HttpServer() = default;  // closes the port; no handler runs afterwards
  // Errors: ErrorKind::usage naming --http where the address cannot be bound. `farm` must outlive the server.
  // `read_token` lets the page be read. An empty page_token: nobody may change jobs by the page.
  static Result<std::unique_ptr<HttpServer>> start(Farm& farm, const std::string& listen,
                                                   const std::string& page_token,
                                                   const std::string& read_token);
  virtual int port() const = 0;
};

// The metrics in Prometheus' text format.
std::string metrics_text(Farm& farm);

}  // namespace candela::master
