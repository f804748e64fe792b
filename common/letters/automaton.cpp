#include "common/letters/automaton.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <map>
#include <optional>
#include <string_view>
#include <unordered_map>
#include <utility>

#include "common/base/nearest_name.h"
#include "common/base/text.h"

namespace candela::letters {
namespace {

// Subsets may be more before states fall together.
constexpr std::size_t kMaxSubsets = 8 * Automaton::kMaxStates;

Error layer_error(const NamedExpression& layer, std::string_view message) {
  return input_error(fmt::format("layer '{}'{}", layer.name, message));
}

// ---- names ----

bool fits(const Token& token, std::uint8_t uses) {
  const std::uint8_t lamp = bit(Letter::lamp), volume = bit(Letter::volume);
  return ((token.letters & lamp) != 0 && (uses & kLampObject) != 0) ||
         ((token.letters & volume) != 0 && (uses & kMediumObject) != 0) ||
         ((token.letters & ~(lamp | volume)) != 0 && (uses & kSurfaceObject) != 0);
}

Result<void> check_name(const NamedExpression& layer, const Token& token,
                        std::span<const ObjectNames> objects, std::span<const std::uint8_t> uses) {
  const std::string_view what = (token.letters & bit(Letter::lamp)) != 0     ? "lamp"
                                : (token.letters & bit(Letter::volume)) != 0 ? "medium"
                                                                             : "surface";
  std::vector<std::string_view> known;
  bool found_elsewhere = false;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const bool fit = uses.empty() || fits(token, uses[i]);
    for (const std::string& name : objects[i]) {
      const bool match = matches_pattern(token.name, name);
      if (match && fit) return {};
      found_elsewhere |= match;
      if (fit) known.push_back(name);
    }
  }
  Error error = layer_error(layer, fmt::format(", column {}: no {} is called {}", token.column,
                                               uses.empty() ? "object" : what, quote(token.name)));
  const std::string_view nearest = nearest_name(token.name, known);
  return std::move(error).with_mend(
      found_elsewhere   ? fmt::format("objects of that name are no {}", what == "medium" ? "media" : what)
      : nearest.empty() ? "`candela objects SCENE` lists the names"
                        : did_you_mean(nearest));
}

Result<void> check_names(const NamedExpression& layer, const Node& tree, std::span<const ObjectNames> objects,
                         std::span<const std::uint8_t> uses) {
  Result<void> verdict;
  for_each_token(tree, [&](const Token& token) {
    if (verdict.ok() && !token.name.empty()) verdict = check_name(layer, token, objects, uses);
  });
  return verdict;
}

// ---- paths ----

// Strings L ... E, the shortest to each state of the automaton.
class Paths {
 public:
  Paths(const Dfa& dfa, const Alphabet& alphabet, bool possible_only) : dfa_(dfa), alphabet_(alphabet) {
    for (std::size_t c = 0; c < alphabet.size(); ++c)
      if (!possible_only || alphabet.possible(static_cast<Alphabet::Class>(c)))
        classes_[static_cast<std::size_t>(alphabet.place(static_cast<Alphabet::Class>(c)))].push_back(c);
    reached_.resize(dfa.size());
    for (const std::size_t c : classes_[0]) reach(kStart, 0, c);
    for (std::size_t i = 0; i < order_.size(); ++i)
      for (const std::size_t c : classes_[1]) reach(order_[i], order_[i], c);
  }

  // Calls visit(state before E, expressions that match) for each; stops when visit returns false.
  template <class Visit>
  void for_each(const Visit& visit) const {
    for (const std::size_t q : order_)
      for (const std::size_t e : classes_[2])
        if (!visit(q, dfa_.accepted[dfa_.next[q * dfa_.class_count + e]])) return;
  }

  // "L DR E"
  std::string example(std::size_t q) const {
    std::string text = "E";
    for (; q != kStart; q = reached_[q]->from)
      text = alphabet_.example(static_cast<Alphabet::Class>(reached_[q]->by)) + ' ' + text;
    return text;
  }

 private:
  static constexpr std::size_t kStart = std::numeric_limits<std::size_t>::max();
  struct Step {
    std::size_t from, by;
  };
  void reach(std::size_t from, std::size_t q, std::size_t c) {
    const std::size_t to = dfa_.next[q * dfa_.class_count + c];
    if (reached_[to]) return;
    reached_[to] = Step{from, c};
    order_.push_back(to);
  }

  const Dfa& dfa_;
  const Alphabet& alphabet_;
  std::array<std::vector<std::size_t>, 3> classes_;  // by their place
  std::vector<std::optional<Step>> reached_;
  std::vector<std::size_t> order_;
};

Result<void> check_matches(const LayerRequest& request, const Dfa& dfa, const Alphabet& alphabet) {
  std::vector<std::uint8_t> matched(request.layers.size());
  Paths(dfa, alphabet, false).for_each([&](std::size_t, const std::vector<std::uint8_t>& layers) {
    for (const std::uint8_t layer : layers) matched[layer] = 1;
    return true;
  });
  const auto none = std::find(matched.begin(), matched.end(), 0);
  if (none == matched.end()) return {};
  return layer_error(request.layers[static_cast<std::size_t>(none - matched.begin())], " matches no path")
      .with_mend("a path begins with L, ends with E, and has D, G, S or V between them");
}

Result<void> check_partition(const LayerRequest& request, const Dfa& dfa, const Alphabet& alphabet) {
  const Paths paths(dfa, alphabet, true);
  std::optional<Error> error;
  paths.for_each([&](std::size_t q, const std::vector<std::uint8_t>& layers) {
    if (layers.size() == 1) return true;
    if (layers.empty())
      error =
          input_error(fmt::format("the layers are no partition: none matches the path {}", paths.example(q)))
              .with_mend("add a layer that does, or leave --partition out");
    else
      error = input_error(fmt::format("the layers are no partition: '{}' and '{}' both match the path {}",
                                      request.layers[layers[0]].name, request.layers[layers[1]].name,
                                      paths.example(q)))
                  .with_mend("narrow one of the two, or leave --partition out");
    return false;
  });
  if (error) return *std::move(error);
  return {};
}

// ---- sizes ----

// The first expression for which `fails` holds if it is alone, else the one with the most letters.
Error too_large(const LayerRequest& request, std::span<const Node> trees,
                const std::function<bool(const Node&)>& fails) {
  const std::string_view mend = "count vertices from one end alone, or write fewer of them behind a *";
  for (std::size_t i = 0; i < trees.size(); ++i)
    if (fails(trees[i]))
      return layer_error(request.layers[i], fmt::format(" needs more than {} states", Automaton::kMaxStates))
          .with_mend(std::string(mend));
  const auto most = std::max_element(trees.begin(), trees.end(), [](const Node& a, const Node& b) {
    return position_count(a) < position_count(b);
  });
  return layer_error(request.layers[static_cast<std::size_t>(most - trees.begin())],
                     fmt::format(" and the others together need more than {} states", Automaton::kMaxStates))
      .with_mend("ask for fewer layers at once");
}

}  // namespace

void Automaton::set_forward(const Dfa& dfa) {
  counts_.minimal = dfa.size();
  forward_.assign(dfa.next.begin(), dfa.next.end());
  layers_ = {{}};
  std::map<std::vector<std::uint8_t>, Label> known{{{}, 0}};
  for (const std::vector<std::uint8_t>& accepted : dfa.accepted) {
    const auto [found, is_new] = known.emplace(accepted, static_cast<Label>(layers_.size()));
    if (is_new) layers_.push_back(accepted);
    labels_.push_back(found->second);
  }
}

bool Automaton::set_reverse() {
  const std::size_t states = counts_.minimal, classes = counts_.classes;
  std::unordered_map<std::vector<Label>, State, HashNumbers> known{{labels_, 0}};
  table_ = labels_;
  reverse_.clear();
  for (std::size_t r = 0; r < known.size(); ++r)
    for (std::size_t c = 0; c < classes; ++c) {
      std::vector<Label> column(states);
      for (std::size_t q = 0; q < states; ++q) column[q] = table_[r * states + forward_[q * classes + c]];
      const auto [found, is_new] = known.try_emplace(std::move(column), static_cast<State>(known.size()));
      if (is_new) {
        if (known.size() > kMaxStates) return false;
        table_.insert(table_.end(), found->first.begin(), found->first.end());
      }
      reverse_.push_back(found->second);
    }
  counts_.reverse = known.size();
  counts_.table = table_.size();
  before_eye_ = 0;
  after_eye_ = reverse(0, class_of(Letter::eye, Side::none, kNoObject, 0));
  return true;
}

Result<Automaton> Automaton::compile(const LayerRequest& request, std::span<const ObjectNames> objects,
                                     std::span<const std::uint8_t> uses) {
  if (request.light_groups) return internal_error("light groups are not expanded");
  CANDELA_TRY(check(request));
  std::vector<Node> trees;
  std::size_t positions = 0;
  for (const NamedExpression& layer : request.layers) {
    CANDELA_ASSIGN(Node tree, parse_expression(layer.text));
    CANDELA_TRY(check_names(layer, tree, objects, uses));
    positions += position_count(tree);
    if (positions > kMaxPositions)
      return layer_error(layer, fmt::format(" and those before it have more than {} letters", kMaxPositions))
          .with_mend("ask for fewer layers at once");
    trees.push_back(std::move(tree));
  }
  std::vector<std::string> regions;
  for (const Region& region : request.regions) regions.push_back(region.name);

  const auto forward_of = [](std::span<const Node> some, std::span<const Set> atoms, const Alphabet& alphabet,
                             Counts* counts) -> std::optional<Dfa> {
    const Nfa nfa = make_nfa(some, atoms);
    const std::optional<Dfa> dfa = make_dfa(nfa, alphabet, kMaxSubsets);
    if (!dfa) return std::nullopt;
    if (counts != nullptr) *counts = {alphabet.size(), nfa.state_count, dfa->size(), 0, 0, 0};
    return minimized(*dfa, kMaxStates);
  };
  const std::vector<Set> atoms = distinct_atoms(trees);
  CANDELA_ASSIGN(Alphabet alphabet, Alphabet::make(atoms, regions, objects, uses));
  Automaton automaton(std::move(alphabet));
  const std::optional<Dfa> dfa = forward_of(trees, atoms, automaton.alphabet_, &automaton.counts_);
  if (!dfa)
    return too_large(request, trees, [&](const Node& tree) {
      return !forward_of(std::span(&tree, 1), atoms, automaton.alphabet_, nullptr);
    });
  CANDELA_TRY(check_matches(request, *dfa, automaton.alphabet_));
  automaton.set_forward(*dfa);
  if (!automaton.set_reverse())
    return too_large(request, trees, [&](const Node& tree) {
      Automaton alone(automaton.alphabet_);
      alone.counts_.classes = automaton.counts_.classes;
      const auto one = forward_of(std::span(&tree, 1), atoms, alone.alphabet_, nullptr);
      if (!one) return true;
      alone.set_forward(*one);
      return !alone.set_reverse();
    });
  if (request.partition) CANDELA_TRY(check_partition(request, *dfa, automaton.alphabet_));
  return automaton;
}

}  // namespace candela::letters
