// Grammar of light path expressions, read into a syntax tree:
//
//   expr  := seq ('|' seq)*      seq := (atom ('*' | '+' | '?')?)*
//   atom  := '(' expr ')' | set  set := '[' set+ ']' | '[^' set+ ']' | token
//   token := (L | E | D | G | S | X | V) (R | T)? ('{' name '}')? ('@' region)?
//
// X is [DGS]. [^..] is any of D G S V that is not in it. White space between tokens is ignored. R, T and
// regions belong to D, G, S and X; V has a region, too; L has a name alone, and E nothing. In a name * and ?
// are wildcards, and a backslash makes the next character an ordinary one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/letters/letter.h"

namespace candela::letters {

inline constexpr std::size_t kMaxExpressionBytes = 2048;

constexpr std::uint8_t bit(Letter letter) {
  return static_cast<std::uint8_t>(1U << static_cast<unsigned>(letter));
}

struct Token {
  std::uint8_t letters = 0;  // bits
  Side side = Side::none;    // none: either
  std::string name;          // a pattern; empty: any object
  std::string region;        // empty: anywhere
  std::size_t column = 0;    // of the letter, from 1
};

// Matches one vertex.
struct Set {
  bool negated = false;  // matches D, G, S and V that neither tokens nor sets match
  std::vector<Token> tokens;
  std::vector<Set> sets;
};

struct Node {
  enum class Kind : std::uint8_t { set, sequence, alternatives, optional, star, plus };
  Kind kind = Kind::sequence;
  Set set;                     // of Kind::set alone
  std::vector<Node> children;  // one of optional, star and plus
};

// Errors (input) begin with "column 5: ".
Result<Node> parse_expression(std::string_view text);

// Calls visit(const Token&) for the tokens of a set or a tree, in their order.
template <class Visit>
void for_each_token(const Set& set, const Visit& visit) {
  for (const Token& token : set.tokens) visit(token);
  for (const Set& inner : set.sets) for_each_token(inner, visit);
}
template <class Visit>
void for_each_token(const Node& node, const Visit& visit) {
  if (node.kind == Node::Kind::set) for_each_token(node.set, visit);
  for (const Node& child : node.children) for_each_token(child, visit);
}

// Equal texts have equal meanings.
std::string text_of(const Set& set);

bool matches_pattern(std::string_view pattern, std::string_view name);
// The pattern that matches `name` and nothing else.
std::string pattern_of(std::string_view name);

// Letters, digits, '_', '-' and '.', a letter or '_' first: what may follow '@'.
bool is_region_name(std::string_view name);

}  // namespace candela::letters
