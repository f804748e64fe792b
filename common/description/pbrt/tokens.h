// The words of a pbrt file: directives, quoted strings, numbers and brackets.
#pragma once

#include <deque>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/description/object.h"

namespace candela::description::pbrt {

struct Token {
  std::string_view text;  // of a string without its quotes, its escapes replaced
  bool quoted = false;
  int line = 0;
  std::size_t offset = 0;  // of the first byte in the file
};

class Tokens {
 public:
  // `bytes` must outlive the reader. It starts at `offset`, which lies in `line`.
  Tokens(std::string key, std::string_view bytes, std::size_t offset = 0, int line = 1);

  // The next token; nothing at the end of the file.
  Result<std::optional<Token>> next();
  // Gives the token back: next() returns it again.
  void unget(const Token& token) { returned_ = token; }

  const std::string& key() const { return key_; }
  Location where(const Token& token) const { return {key_, token.line}; }
  Location here() const { return {key_, line_}; }

 private:
  void skip_space();
  Result<Token> quoted_string();

  std::string key_;
  std::string_view bytes_;
  std::size_t at_ = 0;
  int line_ = 1;
  std::optional<Token> returned_;
  std::deque<std::string> unescaped_;  // what tokens with escapes refer to
};

}  // namespace candela::description::pbrt
