#include "master/http/http_message.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <utility>

namespace candela::master {
namespace {

std::string_view reason_of(int code) {
  static constexpr std::pair<int, std::string_view> kReasons[] = {
      {200, "OK"},
      {201, "Created"},
      {202, "Accepted"},
      {304, "Not Modified"},
      {400, "Bad Request"},
      {401, "Unauthorized"},
      {403, "Forbidden"},
      {404, "Not Found"},
      {405, "Method Not Allowed"},
      {409, "Conflict"},
      {411, "Length Required"},
      {413, "Content Too Large"},
      {421, "Misdirected Request"},
      {431, "Request Header Fields Too Large"},
      {500, "Internal Server Error"},
      {503, "Service Unavailable"},
  };
  for (const auto& [number, reason] : kReasons)
    if (number == code) return reason;
  return "Error";
}

int digit_of(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

// Nothing for a broken escape or a NUL.
std::optional<std::string> decoded(std::string_view text, bool plus_is_space) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    char c = text[i];
    if (c == '+' && plus_is_space) c = ' ';
    if (c == '%') {
      const int high = i + 2 < text.size() ? digit_of(text[i + 1]) : -1;
      const int low = i + 2 < text.size() ? digit_of(text[i + 2]) : -1;
      if (high < 0 || low < 0) return std::nullopt;
      c = static_cast<char>(high * 16 + low);
      i += 2;
    }
    if (c == '\0') return std::nullopt;
    out += c;
  }
  return out;
}

// "a=1&b=2"; false for a broken escape.
bool add_values(std::string_view text, std::map<std::string, std::string>& out) {
  while (!text.empty()) {
    const std::string_view pair = text.substr(0, text.find('&'));
    text.remove_prefix(std::min(text.size(), pair.size() + 1));
    if (pair.empty()) continue;
    const std::size_t equals = pair.find('=');
    const auto name = decoded(pair.substr(0, equals), true);
    const auto value =
        decoded(equals == std::string_view::npos ? std::string_view() : pair.substr(equals + 1), true);
    if (!name || !value) return false;
    out[*name] = *value;
  }
  return true;
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t' || text.back() == '\r'))
    text.remove_suffix(1);
  return text;
}

ParsedRequest refuse(int code, std::string_view text) {
  return {.bytes = 1, .error = error_answer(code, text)};
}

// The fields of a head, line by line.
void read_fields(std::string_view lines, HttpRequest& out) {
  while (!lines.empty()) {
    const std::string_view line = lines.substr(0, lines.find('\n'));
    lines.remove_prefix(std::min(lines.size(), line.size() + 1));
    const std::size_t colon = line.find(':');
    if (colon == std::string_view::npos || colon == 0) continue;
    std::string name(line.substr(0, colon));
    std::transform(name.begin(), name.end(), name.begin(),
                   [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
    out.fields.emplace(std::move(name), trimmed(line.substr(colon + 1)));
  }
}

}  // namespace

HttpAnswer error_answer(int code, std::string_view text) {
  return {.code = code, .body = std::string(text) + "\n"};
}

ParsedRequest parse_request(std::string_view text, const BodyLimit& limit) {
  std::size_t head_end = text.find("\r\n\r\n"), body_begin = head_end + 4;
  if (const std::size_t bare = text.find("\n\n"); bare < head_end) {
    head_end = bare;
    body_begin = bare + 2;
  }
  if (head_end == std::string_view::npos)
    return text.size() > kMaxHeadBytes ? refuse(431, "too long") : ParsedRequest{};
  if (head_end > kMaxHeadBytes) return refuse(431, "too long");
  const std::string_view head = text.substr(0, head_end);
  const std::string_view line = head.substr(0, head.find_first_of("\r\n"));
  const std::size_t first = line.find(' '), last = line.rfind(' ');
  if (first == last || !line.substr(last + 1).starts_with("HTTP/1."))
    return refuse(400, "this is not HTTP/1");
  ParsedRequest out{.bytes = body_begin};
  HttpRequest& request = out.request;
  request.method = line.substr(0, first);
  const std::string_view target = line.substr(first + 1, last - first - 1);
  const std::size_t mark = target.find('?');
  const auto path = decoded(target.substr(0, mark), false);
  if (!path || !path->starts_with('/')) return refuse(400, "this is no path");
  request.path = *path;
  if (mark != std::string_view::npos && !add_values(target.substr(mark + 1), request.query))
    return refuse(400, "a % in the query is not followed by two digits");
  read_fields(head.substr(line.size()), request);
  if (request.method != "POST" && request.method != "PUT") return out;
  if (!request.field("transfer-encoding").empty()) return refuse(411, "say Content-Length");
  const std::string_view length = request.field("content-length");
  std::uint64_t bytes = 0;
  if (!length.empty()) {
    const auto [end, error] = std::from_chars(length.data(), length.data() + length.size(), bytes);
    if (error != std::errc() || end != length.data() + length.size())
      return refuse(400, "Content-Length is no number");
  }
  request.body_bytes = bytes;
  if (request.method == "PUT") return out;
  const std::size_t most = limit ? limit(request) : 0;
  if (bytes > std::max(most, kMaxBodyBytes))
    return refuse(413, fmt::format("a body has at most {} bytes", std::max(most, kMaxBodyBytes)));
  if (text.size() < body_begin + bytes) return {};
  if (most > 0) {
    request.body = text.substr(body_begin, bytes);
    out.bytes += bytes;
    return out;
  }
  if (!add_values(text.substr(body_begin, bytes), request.query))
    return refuse(400, "a % in the body is not followed by two digits");
  out.bytes += bytes;
  return out;
}

std::string to_text(const HttpAnswer& answer, bool with_body) {
  std::string text = head_text(answer);
  if (with_body) text += answer.shared ? *answer.shared : answer.body;
  return text;
}

std::string head_text(const HttpAnswer& answer) {
  const std::string& body = answer.shared ? *answer.shared : answer.body;
  std::string text = fmt::format(
      "HTTP/1.1 {} {}\r\nContent-Type: {}\r\nX-Content-Type-Options: nosniff\r\nReferrer-Policy: "
      "no-referrer\r\n"
      "Cross-Origin-Resource-Policy: same-origin\r\nConnection: close\r\n",
      answer.code, reason_of(answer.code), answer.type);
  // Scripts, styles and data of this server alone; nobody may frame the page.
  if (answer.type.starts_with("text/html"))
    text +=
        "Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n";
  if (answer.lasting)
    text += "Cache-Control: private, max-age=31536000, immutable\r\n";
  else
    text += answer.etag.empty() ? "Cache-Control: no-store\r\n"
                                : fmt::format("Cache-Control: no-cache\r\nETag: \"{}\"\r\n", answer.etag);
  if (!answer.file.empty())
    text += fmt::format("Content-Disposition: attachment; filename=\"{}\"\r\n", answer.file);
  if (!answer.cookie.empty()) text += fmt::format("Set-Cookie: {}\r\n", answer.cookie);
  if (answer.code == 401) text += "WWW-Authenticate: Bearer\r\n";
  if (answer.code == 405)
    text += fmt::format("Allow: {}\r\n", answer.allow.empty() ? "GET, HEAD" : answer.allow);
  if (answer.topic.empty()) text += fmt::format("Content-Length: {}\r\n", body.size());
  text += "\r\n";
  return text;
}

}  // namespace candela::master
