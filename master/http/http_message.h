// Requests and answers as text of HTTP/1.1.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace candela::master {

inline constexpr std::size_t kMaxHeadBytes = 8192;
inline constexpr std::size_t kMaxBodyBytes = 4096;  // of a form

struct HttpRequest {
  std::string method;
  std::string path;                           // decoded, without the query
  std::map<std::string, std::string> query;   // decoded; of a POST of a form also its body
  std::string body = {};                      // of a POST that is no form
  std::uint64_t body_bytes = 0;               // as Content-Length says
  std::map<std::string, std::string> fields;  // by name in lower case; a later one of a name is dropped
  std::string_view field(const std::string& name) const {
    const auto it = fields.find(name);
    return it == fields.end() ? std::string_view() : std::string_view(it->second);
  }
};

struct HttpAnswer {
  int code = 200;
  std::string type = "text/plain; charset=utf-8";
  std::string body = {};
  std::shared_ptr<const std::string> shared =
      {};                   // the body where many clients get the same; `body` is empty
  std::string etag = {};    // empty: not to be kept
  bool lasting = false;     // its address will never mean anything else
  std::string file = {};    // the name under which a browser saves it; empty: it shows it
  std::string cookie = {};  // to be set; empty: none
  std::string allow = {};   // methods, of an answer 405; empty: GET and HEAD
  std::string topic = {};   // not empty: a stream of events, which begins with `body` and stays open
};

struct ParsedRequest {
  std::size_t bytes = 0;                 // of the whole request; 0: it is not whole yet
  HttpRequest request = {};              // if it is whole and no error
  std::optional<HttpAnswer> error = {};  // what to say to a request that cannot be read
};
// Bytes that the body of a POST may have, asked when its head is there; 0: it is a form, with at most
// kMaxBodyBytes. A PUT is whole with its head: its body is read by who wants it.
using BodyLimit = std::function<std::size_t(const HttpRequest&)>;
ParsedRequest parse_request(std::string_view text, const BodyLimit& limit = {});

// Without the body.
std::string head_text(const HttpAnswer& answer);
// With the body unless it is the answer to HEAD.
std::string to_text(const HttpAnswer& answer, bool with_body = true);

HttpAnswer error_answer(int code, std::string_view text);

}  // namespace candela::master
