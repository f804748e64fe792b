#include "common/description/pbrt/words.h"

#include <fmt/format.h>

#include "common/description/check.h"
#include "common/description/text.h"
#include "common/description/transform.h"

namespace candela::description::pbrt {
namespace {

Location place_of(const Tokens& tokens, const std::optional<Token>& token) {
  return token ? tokens.where(*token) : tokens.here();
}

Result<void> bracket(Tokens& tokens, const Token& directive, std::string_view expected) {
  CANDELA_ASSIGN(const std::optional<Token> token, tokens.next());
  if (token && !token->quoted && token->text == expected) return {};
  return error_at(place_of(tokens, token), fmt::format("{} needs 16 numbers in brackets", directive.text));
}

}  // namespace

Result<std::string> read_string(Tokens& tokens, const Token& directive) {
  CANDELA_ASSIGN(const std::optional<Token> token, tokens.next());
  if (!token || !token->quoted)
    return error_at(place_of(tokens, token), fmt::format("{} needs a string in quotes", directive.text));
  return std::string(token->text);
}

Result<double> read_number(Tokens& tokens, const Token& directive) {
  CANDELA_ASSIGN(const std::optional<Token> token, tokens.next());
  const std::optional<double> value = token && !token->quoted ? text::to_number(token->text) : std::nullopt;
  if (value) return *value;
  const std::string found = token ? fmt::format(", not {}", text::quote(token->text)) : std::string();
  return error_at(place_of(tokens, token), fmt::format("{} needs a finite number{}", directive.text, found));
}

Result<Mat4> read_matrix(Tokens& tokens, const Token& directive) {
  CANDELA_TRY(bracket(tokens, directive, "["));
  CANDELA_ASSIGN(const auto values, read_numbers<16>(tokens, directive));
  CANDELA_TRY(bracket(tokens, directive, "]"));
  Mat4 m{};
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t j = 0; j < 4; ++j) m[4 * i + j] = values[4 * j + i];
  if (!transform::is_affine(m))
    return error_at(tokens.where(directive), fmt::format("the matrix of {} is not affine", directive.text));
  return m;
}

}  // namespace candela::description::pbrt
