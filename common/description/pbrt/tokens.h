// The words of a pbrt file: directives, quoted strings, numbers and brackets.
#pragma once

#include <deque>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/description/object.h"
#include "common/description/reading_budget.h"

namespace candela::description::pbrt {

struct Token {
  std::string_view text;  // of a string without its quotes, its escapes replaced
  bool quoted = false;
  int line = 0;
  std::size_t offset = 0;            // of the first byte in the file
  const std::string* key = nullptr;  // of its file
};

class Tokens {
 public:
  // `bytes` must outlive the reader. It starts at `offset`, which lies in `line`. `includer`: the file that
  // includes this one; a directive that this file ends within goes on there. It may be null. `budget`, which
  // outlives this, is that of the parameters that are read too.
  Tokens(std::string key, std::string_view bytes, std::size_t offset = 0, int line = 1,
         Tokens* includer = nullptr, ReadingBudget& budget = ReadingBudget::unlimited());
  Tokens(const Tokens&) = delete;
  Tokens& operator=(const Tokens&) = delete;

  // The next token, of the including file behind the end of this one; nothing at the end of both.
  Result<std::optional<Token>> next();
  // The next token's value, if it is a plain decimal (plain_decimal.h) and, for `whole`, a whole number. If
  // not, or if the file ends behind it, nothing is taken.
  std::optional<double> next_plain_decimal(bool whole);
  // Gives the token back: next() returns it again.
  void unget(const Token& token);
  // True if this file has no token left.
  bool at_end();

  const std::string& key() const { return key_; }
  Location where(const Token& token) const { return {token.key != nullptr ? *token.key : key_, token.line}; }
  Location here() const;
  ReadingBudget& budget() const { return budget_; }

 private:
  void skip_space();
  Result<Token> quoted_string();

  std::string key_;
  std::string_view bytes_;
  std::size_t at_ = 0;
  int line_ = 1;
  Tokens* includer_ = nullptr;
  std::optional<Token> returned_;
  std::deque<std::string> unescaped_;  // what tokens with escapes refer to
  ReadingBudget& budget_;
  Charge charge_;  // of those strings
};

}  // namespace candela::description::pbrt
