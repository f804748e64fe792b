#include "common/letters/normal_form.h"

#include <fmt/format.h>

#include <cstdint>
#include <set>

namespace candela::letters {
namespace {

std::string joined(const std::set<std::string>& parts, char between) {
  std::string text;
  for (const std::string& part : parts) text += (text.empty() ? "" : std::string(1, between)) + part;
  return text;
}

// One text a letter and token: X is [DGS].
std::string of_set(const Set& set) {
  std::set<std::string> members;
  for (const Token& token : set.tokens)
    for (std::uint8_t letter = 1; letter != 0; letter = static_cast<std::uint8_t>(letter << 1))
      if ((token.letters & letter) != 0)
        members.insert(fmt::format("{:x}{}{}:{}@{}", letter, static_cast<int>(token.side), token.name.size(),
                                   token.name, token.region));
  for (const Set& inner : set.sets) members.insert(of_set(inner));
  return fmt::format("[{}{}]", set.negated ? "^" : "", joined(members, ' '));
}

}  // namespace

std::string normal_form(const Node& node) {
  std::string text;
  switch (node.kind) {
    case Node::Kind::set:
      return of_set(node.set);
    case Node::Kind::sequence:
      for (const Node& child : node.children) text += normal_form(child);
      return text;
    case Node::Kind::alternatives: {
      std::set<std::string> branches;
      for (const Node& child : node.children) branches.insert(normal_form(child));
      return branches.size() == 1 ? *branches.begin() : "(" + joined(branches, '|') + ")";
    }
    case Node::Kind::optional:
    case Node::Kind::star:
    case Node::Kind::plus:
      break;
  }
  const char sign = node.kind == Node::Kind::star ? '*' : node.kind == Node::Kind::plus ? '+' : '?';
  return fmt::format("({}){}", normal_form(node.children.front()), sign);
}

}  // namespace candela::letters
