// Requests to the page on any bytes: a request is read whole or not at all, takes bytes that are there, does
// not depend on how it arrives, and each answer is a well-formed message.
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>

#include "master/http/http_message.h"

namespace {

using namespace candela::master;

void require(bool holds) {
  if (!holds) std::abort();
}

bool same(const ParsedRequest& a, const ParsedRequest& b) {
  if (a.bytes != b.bytes || a.error.has_value() != b.error.has_value()) return false;
  if (a.error) return a.error->code == b.error->code && a.error->body == b.error->body;
  return a.request.method == b.request.method && a.request.path == b.request.path &&
         a.request.query == b.request.query && a.request.fields == b.request.fields;
}

// One head, then an empty line, then the body; no line of the head but the last is empty.
void check_answer(const HttpAnswer& answer) {
  const std::string text = to_text(answer);
  require(text.starts_with("HTTP/1.1 "));
  const std::size_t end = text.find("\r\n\r\n");
  require(end != std::string::npos && text.substr(end + 4) == answer.body);
  require(to_text(answer, false) == text.substr(0, end + 4));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const ParsedRequest whole = parse_request(text);
  require(whole.bytes <= size);
  if (whole.bytes == 0) {
    require(!whole.error);
    // A server that waits for more waits for a bounded number of bytes.
    require(size <= kMaxHeadBytes + kMaxBodyBytes + 4);
    return 0;
  }
  if (whole.error) {
    require(whole.error->code >= 400 && whole.error->code < 500);
    check_answer(*whole.error);
    return 0;
  }
  const HttpRequest& request = whole.request;
  require(request.path.starts_with('/') && request.path.find('\0') == std::string::npos);
  for (const auto& [name, value] : request.query)
    require(name.find('\0') == std::string::npos && value.find('\0') == std::string::npos);
  for (const auto& [name, value] : request.fields) {
    require(!name.empty() && name.find_first_of(":\n") == std::string::npos);
    require(value.find('\n') == std::string::npos);
  }
  // Bytes after a request are not looked at.
  require(same(whole, parse_request(text.substr(0, whole.bytes))));
  require(same(whole, parse_request(std::string(text.substr(0, whole.bytes)) + "GET / HTTP/1.1\r\n\r\n")));
  return 0;
}
