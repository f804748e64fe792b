#include "common/description/pbrt/tokens.h"

#include <cmath>
#include <utility>

#include "common/base/plain_decimal.h"
#include "common/description/check.h"
#include "common/description/text.h"

namespace candela::description::pbrt {
namespace {

bool is_space(char c) {
  return c == ' ' || c == '\n' || c == '\t' || c == '\r';
}

bool ends_word(char c) {
  return is_space(c) || c == '"' || c == '[' || c == ']' || c == '#';
}

std::optional<char> unescape(char c) {
  switch (c) {
    case 'b':
      return '\b';
    case 'f':
      return '\f';
    case 'n':
      return '\n';
    case 'r':
      return '\r';
    case 't':
      return '\t';
    case '\\':
    case '\'':
    case '"':
      return c;
    default:
      return std::nullopt;
  }
}

}  // namespace

Tokens::Tokens(std::string key, std::string_view bytes, std::size_t offset, int line, Tokens* includer,
               ReadingBudget& budget)
    : key_(std::move(key)),
      bytes_(bytes),
      at_(offset),
      line_(line),
      includer_(includer),
      budget_(budget),
      charge_(budget) {}

void Tokens::unget(const Token& token) {
  if (token.key != &key_ && includer_ != nullptr)
    includer_->unget(token);
  else
    returned_ = token;
}

bool Tokens::at_end() {
  if (returned_) return false;
  skip_space();
  return at_ >= bytes_.size();
}

Location Tokens::here() const {
  return at_ >= bytes_.size() && includer_ != nullptr ? includer_->here() : Location{key_, line_};
}

void Tokens::skip_space() {
  while (at_ < bytes_.size()) {
    const char c = bytes_[at_];
    if (c == '#') {
      while (at_ < bytes_.size() && bytes_[at_] != '\n') ++at_;
    } else if (is_space(c)) {
      line_ += c == '\n' ? 1 : 0;
      ++at_;
    } else {
      return;
    }
  }
}

Result<Token> Tokens::quoted_string() {
  Token token{{}, true, line_, at_, &key_};
  const std::size_t begin = ++at_;
  std::string* changed = nullptr;
  for (; at_ < bytes_.size() && bytes_[at_] != '\n'; ++at_) {
    char c = bytes_[at_];
    if (c == '"') {
      token.text = changed != nullptr ? std::string_view(*changed) : bytes_.substr(begin, at_ - begin);
      ++at_;
      return token;
    }
    if (c == '\\') {
      if (changed == nullptr) {
        const std::size_t bytes = sizeof(std::string) + at_ - begin;
        CANDELA_TRY(charge_.add(bytes, {key_, line_}, "the file's strings"));
        changed = &unescaped_.emplace_back(bytes_.substr(begin, at_ - begin));
      }
      const std::optional<char> meant = ++at_ < bytes_.size() ? unescape(bytes_[at_]) : std::nullopt;
      if (!meant) return error_at({key_, line_}, "a string has an unknown escape after its backslash");
      c = *meant;
    }
    if (changed == nullptr) continue;
    if (changed->size() == changed->capacity())
      CANDELA_TRY(charge_.add(2 * changed->size(), {key_, line_}, "the file's strings"));
    *changed += c;
  }
  return error_at({key_, line_}, "a string has no closing quote in its line");
}

std::optional<double> Tokens::next_plain_decimal(bool whole) {
  if (returned_) return std::nullopt;
  skip_space();
  const char* const end = bytes_.data() + bytes_.size();
  double value = 0;
  const char* const stop = read_plain_decimal(bytes_.data() + at_, end, value);
  if (stop == nullptr || stop == end || !ends_word(*stop)) return std::nullopt;
  if (whole && value != std::floor(value)) return std::nullopt;
  at_ = static_cast<std::size_t>(stop - bytes_.data());
  return value;
}

Result<std::optional<Token>> Tokens::next() {
  if (returned_) return std::exchange(returned_, std::nullopt);
  if (at_end()) return includer_ != nullptr ? includer_->next() : std::optional<Token>();
  if (bytes_[at_] == '"') {
    CANDELA_ASSIGN(const Token token, quoted_string());
    return std::optional<Token>(token);
  }
  const std::size_t begin = at_++;
  if (bytes_[begin] != '[' && bytes_[begin] != ']')
    while (at_ < bytes_.size() && !ends_word(bytes_[at_])) ++at_;
  return std::optional<Token>({bytes_.substr(begin, at_ - begin), false, line_, begin, &key_});
}

}  // namespace candela::description::pbrt
