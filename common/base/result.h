// Errors as values across module borders. A Result<T> is a T or an Error; an Error names the file, the line
// or field, and the mend, so that the one message a person sees is enough.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <variant>

namespace candela {

// Kind of error, which decides the exit code (docs: exit codes) and whether a retry can help.
enum class ErrorKind {
  usage,        // a wrong option or argument                     exit 2
  input,        // a scene, file or message that cannot be used   exit 2
  failed,       // the work itself failed                         exit 1
  unreachable,  // a peer that does not answer; retry             exit 3
  refused,      // the peer answered no: stale, duplicate, state  exit 1
  resource,     // disk full, queue full, limits; retry           exit 1
  internal,     // our own mistake                                exit 1
};

struct Error {
  ErrorKind kind = ErrorKind::internal;
  std::string message;  // one sentence, no final period, no newline
  std::string file;     // empty where there is none
  int line = 0;         // 1-based; 0 where there is none
  std::string field;    // option, element, property or message field
  std::string mend;     // what to do about it; may be empty

  // "scene.xml:12: unknown plugin 'difuse' (did you mean 'diffuse'?)"
  std::string to_string() const;
  int exit_code() const;

  Error&& at(std::string file_name, int line_number) && {
    file = std::move(file_name);
    line = line_number;
    return std::move(*this);
  }
  Error&& with_field(std::string name) && {
    field = std::move(name);
    return std::move(*this);
  }
  Error&& with_mend(std::string text) && {
    mend = std::move(text);
    return std::move(*this);
  }
};

inline Error input_error(std::string message) {
  return {ErrorKind::input, std::move(message), {}, 0, {}, {}};
}
inline Error usage_error(std::string message) {
  return {ErrorKind::usage, std::move(message), {}, 0, {}, {}};
}
inline Error failed_error(std::string message) {
  return {ErrorKind::failed, std::move(message), {}, 0, {}, {}};
}
inline Error unreachable_error(std::string message) {
  return {ErrorKind::unreachable, std::move(message), {}, 0, {}, {}};
}
inline Error refused_error(std::string message) {
  return {ErrorKind::refused, std::move(message), {}, 0, {}, {}};
}
inline Error resource_error(std::string message) {
  return {ErrorKind::resource, std::move(message), {}, 0, {}, {}};
}
inline Error internal_error(std::string message) {
  return {ErrorKind::internal, std::move(message), {}, 0, {}, {}};
}

template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}      // NOLINT: implicit by design
  Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}  // NOLINT: implicit by design

  bool ok() const { return state_.index() == 0; }
  explicit operator bool() const { return ok(); }
  T& value() & { return std::get<0>(state_); }
  const T& value() const& { return std::get<0>(state_); }
  T&& value() && { return std::get<0>(std::move(state_)); }
  T& operator*() & { return value(); }
  const T& operator*() const& { return value(); }
  T&& operator*() && { return std::move(*this).value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }
  const Error& error() const& { return std::get<1>(state_); }
  Error&& error() && { return std::get<1>(std::move(state_)); }

 private:
  std::variant<T, Error> state_;
};

template <>
class [[nodiscard]] Result<void> {
 public:
  Result() = default;
  Result(Error error) : error_(std::move(error)) {}  // NOLINT: implicit by design
  bool ok() const { return !error_.has_value(); }
  explicit operator bool() const { return ok(); }
  const Error& error() const& { return *error_; }
  Error&& error() && { return std::move(*error_); }

 private:
  std::optional<Error> error_;
};

// Returns the error of `expr` from the enclosing function, or goes on.
#define CANDELA_TRY(expr)                                                                       \
  do {                                                                                          \
    if (auto candela_try_ = (expr); !candela_try_.ok()) return std::move(candela_try_).error(); \
  } while (false)

#define CANDELA_CONCAT_(a, b) a##b
#define CANDELA_CONCAT(a, b) CANDELA_CONCAT_(a, b)
// Declares or assigns `target` from a Result, or returns its error.
#define CANDELA_ASSIGN(target, expr) CANDELA_ASSIGN_(CANDELA_CONCAT(candela_result_, __LINE__), target, expr)
#define CANDELA_ASSIGN_(tmp, target, expr)      \
  auto tmp = (expr);                            \
  if (!tmp.ok()) return std::move(tmp).error(); \
  target = std::move(tmp).value()

}  // namespace candela
