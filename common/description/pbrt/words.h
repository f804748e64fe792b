// Reads the arguments of a pbrt directive that have no name: strings, numbers, matrices.
#pragma once

#include <array>
#include <string>

#include "common/description/pbrt/tokens.h"

namespace candela::description::pbrt {

// `directive`: the word that they belong to, for errors.
Result<std::string> read_string(Tokens& tokens, const Token& directive);
Result<double> read_number(Tokens& tokens, const Token& directive);

template <std::size_t n>
Result<std::array<double, n>> read_numbers(Tokens& tokens, const Token& directive) {
  std::array<double, n> values{};
  for (double& value : values) {
    CANDELA_ASSIGN(value, read_number(tokens, directive));
  }
  return values;
}

// The 16 numbers of an affine matrix in brackets, column by column.
Result<Mat4> read_matrix(Tokens& tokens, const Token& directive);

}  // namespace candela::description::pbrt
