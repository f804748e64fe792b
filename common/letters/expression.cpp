#include "common/letters/expression.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "common/base/text.h"

namespace candela::letters {
namespace {

constexpr std::size_t kMaxDepth = 64;
constexpr std::string_view kLetters = "LEDGSV";  // in the order of Letter
constexpr std::uint8_t kScattering = bit(Letter::diffuse) | bit(Letter::glossy) | bit(Letter::specular);

bool is_space(char c) {
  return c == ' ' || c == '\t' || c == '\n' || c == '\r';
}
bool begins_region_name(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
}
bool continues_region_name(char c) {
  return begins_region_name(c) || (c >= '0' && c <= '9') || c == '-' || c == '.';
}
bool is_repeat(char c) {
  return c == '*' || c == '+' || c == '?';
}

// Recursive descent: a function for each rule of the grammar.
class Parser {
 public:
  explicit Parser(std::string_view text) : text_(text) {}

  Result<Node> whole() {
    CANDELA_ASSIGN(Node node, alternatives(0));
    if (!at_end()) return error_at(at_, "')' closes nothing", "take it away, or write '(' before it");
    return node;
  }

 private:
  Result<Node> alternatives(std::size_t depth) {
    Node node{Node::Kind::alternatives, {}, {}};
    while (true) {
      CANDELA_ASSIGN(Node branch, sequence(depth));
      node.children.push_back(std::move(branch));
      if (!take('|')) return node;
    }
  }

  Result<Node> sequence(std::size_t depth) {
    Node node{Node::Kind::sequence, {}, {}};
    for (skip(); !at_end() && text_[at_] != '|' && text_[at_] != ')'; skip()) {
      CANDELA_ASSIGN(Node atom, repeated(depth));
      node.children.push_back(std::move(atom));
    }
    return node;
  }

  Result<Node> repeated(std::size_t depth) {
    const std::size_t begin = at_;
    Node node;
    if (take('(')) {
      if (depth == kMaxDepth)
        return error_at(begin, fmt::format("parentheses are nested deeper than {}", kMaxDepth), "");
      CANDELA_ASSIGN(node, alternatives(depth + 1));
      if (!take(')')) return error_at(begin, "this '(' is not closed", "write ')'");
    } else {
      node.kind = Node::Kind::set;
      CANDELA_ASSIGN(node.set, set(depth));
    }
    skip();
    if (at_end() || !is_repeat(text_[at_])) return node;
    const char sign = text_[at_++];
    skip();
    if (!at_end() && is_repeat(text_[at_]))
      return error_at(at_, fmt::format("'{}' follows '{}'", text_[at_], sign),
                      "one is enough, or use parentheses");
    Node repeat{sign == '*'   ? Node::Kind::star
                : sign == '+' ? Node::Kind::plus
                              : Node::Kind::optional,
                {},
                {}};
    repeat.children.push_back(std::move(node));
    return repeat;
  }

  Result<Set> set(std::size_t depth) {
    const std::size_t begin = at_;
    Set found;
    if (!take('[')) {
      CANDELA_ASSIGN(Token one, token());
      found.tokens.push_back(std::move(one));
      return found;
    }
    if (depth == kMaxDepth)
      return error_at(begin, fmt::format("sets are nested deeper than {}", kMaxDepth), "");
    found.negated = take('^');
    for (skip(); !take(']'); skip()) {
      if (at_end()) return error_at(begin, "this '[' is not closed", "write ']'");
      if (text_[at_] == '(' || text_[at_] == ')' || text_[at_] == '|' || is_repeat(text_[at_]))
        return error_at(at_, fmt::format("'{}' is inside [ ], which matches one vertex", text_[at_]),
                        "use ( | ) for alternatives of several vertices");
      CANDELA_ASSIGN(Set inner, set(depth + 1));
      if (inner.negated || !inner.sets.empty())
        found.sets.push_back(std::move(inner));
      else
        std::move(inner.tokens.begin(), inner.tokens.end(), std::back_inserter(found.tokens));
    }
    if (found.tokens.empty() && found.sets.empty())
      return error_at(begin, "the set is empty", "write letters between [ and ]");
    return found;
  }

  Result<Token> token() {
    Token found;
    found.column = at_ + 1;
    CANDELA_ASSIGN(found.letters, letter());
    const char written = text_[at_ - 1];
    const std::string_view mend_side = "R and T stand behind D, G, S and X";
    skip();
    if (!at_end() && (text_[at_] == 'R' || text_[at_] == 'T')) {
      if ((found.letters & ~kScattering) != 0)
        return error_at(at_, fmt::format("{} has no {}", written, text_[at_]), mend_side);
      found.side = text_[at_++] == 'R' ? Side::reflected : Side::transmitted;
      skip();
    }
    if (!at_end() && text_[at_] == '{') {
      if (written == 'E') return error_at(at_, "E has no name", "write E alone");
      CANDELA_ASSIGN(found.name, name());
      skip();
    }
    if (!at_end() && text_[at_] == '@') {
      if (written == 'L' || written == 'E')
        return error_at(at_, fmt::format("{} has no region", written), "D, G, S, X and V have");
      CANDELA_ASSIGN(found.region, region());
    }
    return found;
  }

  Result<std::uint8_t> letter() {
    const char c = text_[at_];
    if (c == 'X') {
      ++at_;
      return kScattering;
    }
    const std::size_t index = kLetters.find(c);
    if (index != std::string_view::npos) {
      ++at_;
      return bit(static_cast<Letter>(index));
    }
    if (c == 'R' || c == 'T')
      return error_at(at_, fmt::format("{} does not follow a letter", c),
                      "R and T stand behind D, G, S and X");
    if (is_repeat(c))
      return error_at(at_, fmt::format("'{}' has nothing to repeat", c), "write a letter before it");
    if (c == '{' || c == '@')
      return error_at(at_, fmt::format("'{}' does not follow a letter", c),
                      "names and regions belong to a letter");
    if (c == ']') return error_at(at_, "']' closes nothing", "take it away, or write '[' before it");
    const std::size_t length = std::max<std::size_t>(utf8_length(text_.substr(at_)), 1);
    return error_at(at_, fmt::format("{} is no letter", quote(text_.substr(at_, length))),
                    "letters are L, E, D, G, S, X and V");
  }

  Result<std::string> name() {
    const std::size_t open = at_++;
    const std::size_t begin = at_;
    while (!at_end() && text_[at_] != '}') at_ += text_[at_] == '\\' ? 2 : 1;
    if (at_end()) return error_at(open, "this '{' is not closed", "write '}'");
    std::string_view found = text_.substr(begin, at_++ - begin);
    while (!found.empty() && is_space(found.front())) found.remove_prefix(1);
    // A space behind a backslash is a part of the name.
    while (found.size() > 1 && is_space(found.back()) && found[found.size() - 2] != '\\')
      found.remove_suffix(1);
    if (found.empty() || (found.size() == 1 && is_space(found.front())))
      return error_at(open, "the name is empty", "write the name of an object, or no { }");
    return std::string(found);
  }

  Result<std::string> region() {
    const std::size_t sign = at_++;
    const std::size_t begin = at_;
    if (!at_end() && begins_region_name(text_[at_]))
      while (!at_end() && continues_region_name(text_[at_])) ++at_;
    if (at_ == begin)
      return error_at(sign, "no region follows '@'", "write its name, which begins with a letter");
    return std::string(text_.substr(begin, at_ - begin));
  }

  static Error error_at(std::size_t offset, std::string message, std::string_view mend) {
    return input_error(fmt::format("column {}: {}", offset + 1, message)).with_mend(std::string(mend));
  }
  bool at_end() const { return at_ >= text_.size(); }
  void skip() {
    while (!at_end() && is_space(text_[at_])) ++at_;
  }
  bool take(char c) {
    skip();
    if (at_end() || text_[at_] != c) return false;
    ++at_;
    return true;
  }

  std::string_view text_;
  std::size_t at_ = 0;
};

}  // namespace

Result<Node> parse_expression(std::string_view text) {
  if (text.size() > kMaxExpressionBytes)
    return input_error(fmt::format("column {}: the expression is longer than {} bytes",
                                   kMaxExpressionBytes + 1, kMaxExpressionBytes));
  if (std::all_of(text.begin(), text.end(), is_space))
    return input_error("column 1: the expression is empty").with_mend("L[DGSV]*E matches all paths");
  if (!is_utf8(text)) {
    std::size_t at = 0;
    while (const std::size_t length = utf8_length(text.substr(at))) at += length;
    return input_error(fmt::format("column {}: the byte is not UTF-8", at + 1));
  }
  return Parser(text).whole();
}

std::string text_of(const Set& set) {
  std::string text = set.negated ? "[^" : "[";
  for (const Token& token : set.tokens)
    text += fmt::format("{:x}{}{{{}}}@{} ", token.letters, static_cast<int>(token.side), token.name,
                        token.region);
  for (const Set& inner : set.sets) text += text_of(inner);
  return text + "]";
}

bool matches_pattern(std::string_view pattern, std::string_view name) {
  constexpr std::size_t none = std::string_view::npos;
  std::size_t p = 0, n = 0;
  std::size_t star = none, retry = 0;  // behind the last '*', and where it ends in the name
  while (true) {
    if (p < pattern.size() && pattern[p] == '*') {
      star = ++p;
      retry = n;
      continue;
    }
    if (n == name.size() && p == pattern.size()) return true;
    if (n < name.size() && p < pattern.size()) {
      if (pattern[p] == '?') {
        // One character, not one byte.
        n += std::max<std::size_t>(utf8_length(name.substr(n)), 1);
        ++p;
        continue;
      }
      const std::size_t escape = pattern[p] == '\\' && p + 1 < pattern.size() ? 1 : 0;
      if (pattern[p + escape] == name[n]) {
        p += escape + 1;
        ++n;
        continue;
      }
    }
    if (star == none || retry >= name.size()) return false;
    p = star;
    n = ++retry;
  }
}

std::string pattern_of(std::string_view name) {
  std::string pattern;
  for (const char c : name) {
    if (c == '*' || c == '?' || c == '}' || c == '\\' || is_space(c)) pattern += '\\';
    pattern += c;
  }
  return pattern;
}

bool is_region_name(std::string_view name) {
  return !name.empty() && begins_region_name(name.front()) &&
         std::all_of(name.begin(), name.end(), continues_region_name);
}

}  // namespace candela::letters
