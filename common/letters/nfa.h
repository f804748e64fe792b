// Several expressions as one nondeterministic automaton, and the deterministic one made of it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/letters/alphabet.h"
#include "common/letters/expression.h"

namespace candela::letters {

// States are named by the atom that was read last ("position"): what the states between tell is the sets of
// positions that may follow.
struct Nfa {
  std::size_t state_count = 0;                     // of Thompson's construction
  std::vector<std::uint32_t> atoms;                // [position]: which of the job's sets it matches
  std::vector<std::vector<std::uint64_t>> follow;  // [position]: bits of positions; the last is the start
  std::vector<std::vector<std::uint8_t>>
      accepted;  // [position], the last is the start: expressions that end there
};

inline constexpr std::size_t kMaxPositions = 4096;
std::size_t position_count(const Node& tree);

struct HashNumbers {
  template <class T>
  std::size_t operator()(const std::vector<T>& numbers) const {
    std::uint64_t hash = numbers.size();
    for (const T number : numbers) {
      hash = (hash ^ number) * 0x9e3779b97f4a7c15U;
      hash ^= hash >> 29;
    }
    return static_cast<std::size_t>(hash);
  }
};

// All sets of the trees, each once.
std::vector<Set> distinct_atoms(std::span<const Node> trees);

// Thompson's construction: two states for each token, repeat, sequence and list of alternatives.
// Preconditions: at most kMaxPositions positions and 255 trees; `atoms` has all sets of the trees.
Nfa make_nfa(std::span<const Node> trees, std::span<const Set> atoms);

struct Dfa {
  std::size_t class_count = 0;
  std::vector<std::uint32_t> next;                  // [state * class_count + class]; state 0 is the start
  std::vector<std::vector<std::uint8_t>> accepted;  // [state]: expressions, increasing
  std::size_t size() const { return accepted.size(); }
};

// Subsets of the states, those that a string can reach. nullopt: more than `max_states`, or too much work.
std::optional<Dfa> make_dfa(const Nfa& nfa, const Alphabet& alphabet, std::size_t max_states);

// The smallest equivalent one. nullopt: more than `max_states`, or too much work.
std::optional<Dfa> minimized(const Dfa& dfa, std::size_t max_states);

}  // namespace candela::letters
