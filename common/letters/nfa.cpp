#include "common/letters/nfa.h"

#include <algorithm>
#include <bit>
#include <map>
#include <string>
#include <unordered_map>
#include <utility>

namespace candela::letters {
namespace {

using Bits = std::vector<std::uint64_t>;

// Steps on words of 64 bits or on hash tables: below a second. The same on every machine.
constexpr std::uint64_t kMaxWork = std::uint64_t{1} << 27;

void set(Bits& bits, std::size_t i) {
  bits[i / 64] |= std::uint64_t{1} << (i % 64);
}

template <class Visit>
void for_each_bit(const Bits& bits, const Visit& visit) {
  for (std::size_t word = 0; word < bits.size(); ++word)
    for (std::uint64_t rest = bits[word]; rest != 0; rest &= rest - 1)
      visit(word * 64 + static_cast<std::size_t>(std::countr_zero(rest)));
}

class Thompson {
 public:
  struct Fragment {
    std::uint32_t start, end;
  };

  explicit Thompson(std::span<const Set> atoms) {
    for (std::size_t a = 0; a < atoms.size(); ++a) atom_of_.emplace(text_of(atoms[a]), a);
  }

  Fragment add(const Node& node) {
    const Fragment made{state(), state()};
    switch (node.kind) {
      case Node::Kind::set:
        position_of_[made.start] = static_cast<std::uint32_t>(ends_.size());
        ends_.push_back(made.end);
        atoms_.push_back(static_cast<std::uint32_t>(atom_of_.at(text_of(node.set))));
        break;
      case Node::Kind::sequence: {
        std::uint32_t last = made.start;
        for (const Node& child : node.children) {
          const Fragment part = add(child);
          link(last, part.start);
          last = part.end;
        }
        link(last, made.end);
        break;
      }
      case Node::Kind::alternatives:
      case Node::Kind::optional:
      case Node::Kind::star:
      case Node::Kind::plus:
        for (const Node& child : node.children) {
          const Fragment part = add(child);
          link(made.start, part.start);
          link(part.end, made.end);
          if (node.kind == Node::Kind::star || node.kind == Node::Kind::plus) link(part.end, part.start);
        }
        if (node.kind == Node::Kind::star || node.kind == Node::Kind::optional) link(made.start, made.end);
        break;
    }
    return made;
  }

  // The positions whose token may be read next after the empty string from `from`; calls end(state) for each
  // state that the empty string reaches.
  template <class End>
  Bits closure(std::uint32_t from, const End& end) {
    Bits positions(ends_.size() / 64 + 1);
    std::vector<std::uint32_t> stack{from};
    seen_.resize(links_.size());
    seen_[from] = ++stamp_;
    while (!stack.empty()) {
      const std::uint32_t at = stack.back();
      stack.pop_back();
      end(at);
      if (position_of_[at] != kNone) set(positions, position_of_[at]);
      for (const std::uint32_t to : links_[at])
        if (seen_[to] != stamp_) {
          seen_[to] = stamp_;
          stack.push_back(to);
        }
    }
    return positions;
  }

  std::size_t state_count() const { return links_.size(); }
  const std::vector<std::uint32_t>& ends() const { return ends_; }    // [position]
  const std::vector<std::uint32_t>& atoms() const { return atoms_; }  // [position]

 private:
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
  std::uint32_t state() {
    links_.emplace_back();
    position_of_.push_back(kNone);
    return static_cast<std::uint32_t>(links_.size() - 1);
  }
  void link(std::uint32_t from, std::uint32_t to) { links_[from].push_back(to); }

  std::map<std::string, std::size_t> atom_of_;
  std::vector<std::vector<std::uint32_t>> links_;  // that read nothing
  std::vector<std::uint32_t> position_of_, ends_, atoms_;
  std::vector<std::uint32_t> seen_;
  std::uint32_t stamp_ = 0;
};

void add_atoms(const Node& node, std::map<std::string, std::size_t>& known, std::vector<Set>& atoms) {
  if (node.kind == Node::Kind::set && known.emplace(text_of(node.set), atoms.size()).second)
    atoms.push_back(node.set);
  for (const Node& child : node.children) add_atoms(child, known, atoms);
}

}  // namespace

std::size_t position_count(const Node& tree) {
  std::size_t count = tree.kind == Node::Kind::set ? 1 : 0;
  for (const Node& child : tree.children) count += position_count(child);
  return count;
}

std::vector<Set> distinct_atoms(std::span<const Node> trees) {
  std::map<std::string, std::size_t> known;
  std::vector<Set> atoms;
  for (const Node& tree : trees) add_atoms(tree, known, atoms);
  return atoms;
}

Nfa make_nfa(std::span<const Node> trees, std::span<const Set> atoms) {
  Thompson thompson(atoms);
  std::vector<Thompson::Fragment> parts;
  std::map<std::uint32_t, std::uint8_t> expression_of_end;
  for (const Node& tree : trees) {
    parts.push_back(thompson.add(tree));
    expression_of_end.emplace(parts.back().end, static_cast<std::uint8_t>(parts.size() - 1));
  }
  Nfa nfa;
  nfa.state_count = thompson.state_count();
  nfa.atoms = thompson.atoms();
  std::vector<std::uint8_t> accepted;
  const auto note_end = [&](std::uint32_t state) {
    if (const auto found = expression_of_end.find(state); found != expression_of_end.end())
      accepted.push_back(found->second);
  };
  for (const std::uint32_t end : thompson.ends()) {
    accepted.clear();
    nfa.follow.push_back(thompson.closure(end, note_end));
    nfa.accepted.push_back(accepted);
  }
  Bits start(thompson.ends().size() / 64 + 1);
  accepted.clear();
  for (const Thompson::Fragment& part : parts) {
    const Bits one = thompson.closure(part.start, note_end);
    for (std::size_t word = 0; word < start.size(); ++word) start[word] |= one[word];
  }
  nfa.follow.push_back(std::move(start));
  nfa.accepted.push_back(accepted);
  return nfa;
}

std::optional<Dfa> make_dfa(const Nfa& nfa, const Alphabet& alphabet, std::size_t max_states) {
  const std::size_t words = nfa.follow.back().size(), positions = nfa.atoms.size();
  std::vector<Bits> readers(alphabet.size(), Bits(words));  // [class]: positions that read it
  for (std::size_t c = 0; c < alphabet.size(); ++c)
    for (std::size_t p = 0; p < positions; ++p)
      if (alphabet.matches(nfa.atoms[p], static_cast<Alphabet::Class>(c))) set(readers[c], p);

  Dfa dfa;
  dfa.class_count = alphabet.size();
  std::unordered_map<Bits, std::uint32_t, HashNumbers> known;
  std::vector<const Bits*> subsets;  // [state]; null: the start
  const auto add = [&](const Bits* subset) {
    std::vector<std::uint8_t> accepted;
    const auto add_of = [&](std::size_t p) {
      accepted.insert(accepted.end(), nfa.accepted[p].begin(), nfa.accepted[p].end());
    };
    if (subset != nullptr)
      for_each_bit(*subset, add_of);
    else
      add_of(positions);
    std::sort(accepted.begin(), accepted.end());
    accepted.erase(std::unique(accepted.begin(), accepted.end()), accepted.end());
    subsets.push_back(subset);
    dfa.accepted.push_back(std::move(accepted));
  };
  add(nullptr);
  std::uint64_t work = 0;
  Bits follow(words);
  for (std::size_t q = 0; q < subsets.size(); ++q) {
    if (subsets[q] == nullptr) {
      follow = nfa.follow[positions];
    } else {
      std::fill(follow.begin(), follow.end(), 0);
      for_each_bit(*subsets[q], [&](std::size_t p) {
        for (std::size_t word = 0; word < words; ++word) follow[word] |= nfa.follow[p][word];
        work += words;
      });
    }
    for (const Bits& reads : readers) {
      Bits subset(words);
      for (std::size_t word = 0; word < words; ++word) subset[word] = follow[word] & reads[word];
      work += words + 8;
      const auto [found, is_new] =
          known.try_emplace(std::move(subset), static_cast<std::uint32_t>(subsets.size()));
      if (is_new) add(&found->first);
      dfa.next.push_back(found->second);
    }
    if (subsets.size() > max_states || work > kMaxWork) return std::nullopt;
  }
  return dfa;
}

std::optional<Dfa> minimized(const Dfa& dfa, std::size_t max_states) {
  const std::size_t count = dfa.size();
  // Blocks of states that no string of the length tried so far tells apart, numbered by their first states.
  std::vector<std::uint32_t> block(count);
  std::map<std::vector<std::uint8_t>, std::uint32_t> by_label;
  for (std::size_t q = 0; q < count; ++q)
    block[q] = by_label.emplace(dfa.accepted[q], static_cast<std::uint32_t>(by_label.size())).first->second;
  std::size_t blocks = by_label.size();
  std::uint64_t work = 0;
  std::unordered_map<std::uint64_t, std::uint32_t> refined;
  for (std::size_t before = 0; before != blocks;) {
    before = blocks;
    for (std::size_t c = 0; c < dfa.class_count; ++c) {
      refined.clear();
      std::vector<std::uint32_t> finer(count);
      for (std::size_t q = 0; q < count; ++q) {
        const std::uint64_t key = std::uint64_t{block[q]} << 32 | block[dfa.next[q * dfa.class_count + c]];
        finer[q] = refined.emplace(key, static_cast<std::uint32_t>(refined.size())).first->second;
      }
      block = std::move(finer);
      blocks = refined.size();
      work += 8 * count;
      if (blocks > max_states || work > kMaxWork) return std::nullopt;
    }
  }
  Dfa result;
  result.class_count = dfa.class_count;
  for (std::size_t q = 0; q < count; ++q) {
    if (block[q] != result.accepted.size()) continue;  // no first state of a block
    result.accepted.push_back(dfa.accepted[q]);
    for (std::size_t c = 0; c < dfa.class_count; ++c)
      result.next.push_back(block[dfa.next[q * dfa.class_count + c]]);
  }
  return result;
}

}  // namespace candela::letters
