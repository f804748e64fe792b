// Error <-> grpc::Status. The status message is the one line a person reads; its details hold the parts
// again, as lines of "key=value" after a magic line, so that a client can rebuild the Error instead of
// parsing prose.
#include <algorithm>
#include <charconv>
#include <optional>

#include "common/base/enum_names.h"
#include "common/wire/wire.h"

namespace candela::wire {
namespace {

constexpr std::string_view kMagic = "candela.v1.Error\n";
// Statuses travel in HTTP/2 headers, of which peers accept 8 KiB in all (and the message is percent-encoded
// there).
constexpr std::size_t kMaxTextBytes = 1000;
constexpr std::uint32_t kMaxRetryMs = 60000;

// One line, at most kMaxTextBytes, not cut inside a UTF-8 sequence.
std::string line_of(std::string_view text) {
  if (text.size() > kMaxTextBytes) {
    std::size_t end = kMaxTextBytes;
    while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xc0) == 0x80) --end;
    text = text.substr(0, end);
  }
  std::string line(text);
  for (char& c : line)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';
  return line;
}

std::string_view kind_name(ErrorKind kind) {
  return name_of_value<ErrorKind::internal>(
      {"usage", "input", "failed", "unreachable", "refused", "resource", "internal"}, kind, "internal");
}

grpc::StatusCode code_of(ErrorKind kind) {
  switch (kind) {
    case ErrorKind::usage:
    case ErrorKind::input:
      return grpc::StatusCode::INVALID_ARGUMENT;
    case ErrorKind::failed:
      return grpc::StatusCode::ABORTED;
    case ErrorKind::unreachable:
      return grpc::StatusCode::UNAVAILABLE;
    case ErrorKind::refused:
      return grpc::StatusCode::FAILED_PRECONDITION;
    case ErrorKind::resource:
      return grpc::StatusCode::RESOURCE_EXHAUSTED;
    case ErrorKind::internal:
      return grpc::StatusCode::INTERNAL;
  }
  return grpc::StatusCode::INTERNAL;
}

ErrorKind kind_of(grpc::StatusCode code) {
  switch (code) {
    case grpc::StatusCode::INVALID_ARGUMENT:
    case grpc::StatusCode::OUT_OF_RANGE:
    case grpc::StatusCode::NOT_FOUND:
      return ErrorKind::input;
    case grpc::StatusCode::UNAVAILABLE:
    case grpc::StatusCode::DEADLINE_EXCEEDED:
      return ErrorKind::unreachable;
    case grpc::StatusCode::FAILED_PRECONDITION:
    case grpc::StatusCode::ALREADY_EXISTS:
    case grpc::StatusCode::PERMISSION_DENIED:
    case grpc::StatusCode::UNAUTHENTICATED:
    case grpc::StatusCode::UNIMPLEMENTED:
    case grpc::StatusCode::CANCELLED:
      return ErrorKind::refused;
    case grpc::StatusCode::RESOURCE_EXHAUSTED:
      return ErrorKind::resource;
    case grpc::StatusCode::ABORTED:
    case grpc::StatusCode::DATA_LOSS:
      return ErrorKind::failed;
    default:
      return ErrorKind::internal;
  }
}

// The value of `key` in details of ours.
std::optional<std::string> detail(std::string_view details, std::string_view key) {
  if (!details.starts_with(kMagic)) return std::nullopt;
  details.remove_prefix(kMagic.size());
  while (!details.empty()) {
    const std::size_t end = std::min(details.find('\n'), details.size());
    const std::string_view line = details.substr(0, end);
    if (line.size() > key.size() && line.starts_with(key) && line[key.size()] == '=')
      return std::string(line.substr(key.size() + 1));
    details.remove_prefix(std::min(end + 1, details.size()));
  }
  return std::nullopt;
}

std::string details_of(const Error& error) {
  std::string details(kMagic);
  const auto add = [&](std::string_view key, std::string_view value) {
    if (!value.empty()) details.append(key).append("=").append(line_of(value)).append("\n");
  };
  add("kind", kind_name(error.kind));
  add("message", error.message);
  add("field", error.field);
  add("file", error.file);
  if (error.line > 0) add("line", std::to_string(error.line));
  add("mend", error.mend);
  return details;
}

template <class T>
std::optional<T> number(const std::optional<std::string>& text) {
  T value{};
  if (!text) return std::nullopt;
  const auto [end, code] = std::from_chars(text->data(), text->data() + text->size(), value);
  if (code != std::errc() || end != text->data() + text->size()) return std::nullopt;
  return value;
}

}  // namespace

grpc::Status to_status(const Error& error) {
  return {code_of(error.kind), line_of(error.to_string()), details_of(error)};
}

grpc::Status to_status_with_retry(const Error& error, std::uint32_t retry_ms) {
  return {code_of(error.kind), line_of(error.to_string()),
          details_of(error) + "retry_ms=" + std::to_string(retry_ms) + "\n"};
}

std::uint32_t retry_ms(const grpc::Status& status, std::uint32_t otherwise) {
  const auto value = number<std::uint32_t>(detail(status.error_details(), "retry_ms"));
  return std::min(value.value_or(otherwise), kMaxRetryMs);
}

Error from_status(const grpc::Status& status) {
  Error error;
  error.kind = kind_of(status.error_code());
  const std::string details = status.error_details();
  if (auto message = detail(details, "message")) {
    if (error.kind == ErrorKind::input && detail(details, "kind") == kind_name(ErrorKind::usage))
      error.kind = ErrorKind::usage;
    error.message = std::move(*message);
    error.field = detail(details, "field").value_or("");
    error.file = detail(details, "file").value_or("");
    error.line = std::max(0, number<int>(detail(details, "line")).value_or(0));
    error.mend = detail(details, "mend").value_or("");
    return error;
  }
  // gRPC itself says "Deadline Exceeded", which tells a person little.
  error.message = status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED
                      ? "no answer in time"
                      : line_of(status.error_message());
  if (error.message.empty())
    error.message = "the peer answered with status " + std::to_string(status.error_code());
  return error;
}

}  // namespace candela::wire
