// A matcher of light path expressions without automata: all ends of all parts, over the syntax tree.
#pragma once

#include <algorithm>
#include <cstddef>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "common/letters/expression.h"
#include "common/letters/request.h"

namespace candela::test {

struct PathVertex {
  letters::Letter letter = letters::Letter::lamp;
  letters::Side side = letters::Side::none;
  std::vector<std::string> names;
  std::set<std::string> regions;
};

class Matcher {
 public:
  static bool matches(const letters::Node& tree, std::span<const PathVertex> path) {
    return ends(tree, path, {0}).contains(path.size());
  }

 private:
  using Ends = std::set<std::size_t>;

  static bool one(const letters::Token& token, const PathVertex& vertex) {
    using letters::Letter;
    const bool end = vertex.letter == Letter::lamp || vertex.letter == Letter::eye;
    if ((token.letters & letters::bit(vertex.letter)) == 0) return false;
    if (token.side != letters::Side::none && token.side != vertex.side) return false;
    if (!token.name.empty() &&
        std::none_of(vertex.names.begin(), vertex.names.end(),
                     [&](const std::string& name) { return wildcard(token.name, name); }))
      return false;
    return token.region.empty() || (!end && vertex.regions.contains(token.region));
  }
  // Without escapes.
  static bool wildcard(std::string_view pattern, std::string_view name) {
    if (pattern.empty()) return name.empty();
    if (pattern[0] == '*')
      return wildcard(pattern.substr(1), name) || (!name.empty() && wildcard(pattern, name.substr(1)));
    return !name.empty() && (pattern[0] == '?' || pattern[0] == name[0]) &&
           wildcard(pattern.substr(1), name.substr(1));
  }
  static bool in(const letters::Set& set, const PathVertex& vertex) {
    bool found = false;
    for (const letters::Token& token : set.tokens) found |= one(token, vertex);
    for (const letters::Set& inner : set.sets) found |= in(inner, vertex);
    if (!set.negated) return found;
    return !found && vertex.letter != letters::Letter::lamp && vertex.letter != letters::Letter::eye;
  }
  static Ends ends(const letters::Node& node, std::span<const PathVertex> path, const Ends& begins) {
    using Kind = letters::Node::Kind;
    Ends result;
    switch (node.kind) {
      case Kind::set:
        for (const std::size_t at : begins)
          if (at < path.size() && in(node.set, path[at])) result.insert(at + 1);
        return result;
      case Kind::sequence:
        result = begins;
        for (const letters::Node& child : node.children) result = ends(child, path, result);
        return result;
      case Kind::alternatives:
        for (const letters::Node& child : node.children) result.merge(ends(child, path, begins));
        return result;
      case Kind::optional:
        result = ends(node.children[0], path, begins);
        result.insert(begins.begin(), begins.end());
        return result;
      case Kind::star:
      case Kind::plus: {
        if (node.kind == Kind::star) result = begins;
        for (Ends last = begins; !last.empty();) {
          Ends more;
          for (const std::size_t end : ends(node.children[0], path, last))
            if (result.insert(end).second) more.insert(end);
          last = std::move(more);
        }
        return result;
      }
    }
    return result;
  }
};

}  // namespace candela::test
