#include "common/letters/alphabet.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>

namespace candela::letters {
namespace {

using Bits = std::vector<std::uint64_t>;

constexpr std::uint64_t kMaxEvaluations = std::uint64_t{1} << 25;  // below a second
constexpr std::size_t kMaxClasses = 4096;

struct Symbol {
  Letter letter;
  Side side;
  std::string_view text;
};
constexpr std::array<Symbol, 9> kSymbolTable = {{{Letter::lamp, Side::none, "L"},
                                                 {Letter::eye, Side::none, "E"},
                                                 {Letter::volume, Side::none, "V"},
                                                 {Letter::diffuse, Side::reflected, "DR"},
                                                 {Letter::diffuse, Side::transmitted, "DT"},
                                                 {Letter::glossy, Side::reflected, "GR"},
                                                 {Letter::glossy, Side::transmitted, "GT"},
                                                 {Letter::specular, Side::reflected, "SR"},
                                                 {Letter::specular, Side::transmitted, "ST"}}};

bool get(const Bits& bits, std::size_t i) {
  return (bits[i / 64] >> (i % 64) & 1) != 0;
}
void set(Bits& bits, std::size_t i) {
  bits[i / 64] |= std::uint64_t{1} << (i % 64);
}

// Objects that the same patterns match.
struct Kind {
  Bits patterns;
  std::uint8_t uses = 0;
  std::string example;  // the name of an object that one of the patterns matches
};

// A token with its name and region as numbers.
struct CompiledToken {
  std::uint8_t letters;
  Side side;
  std::size_t pattern, region;  // kAny: any
};
constexpr std::size_t kAny = std::numeric_limits<std::size_t>::max();

struct CompiledSet {
  bool negated = false;
  std::vector<CompiledToken> tokens;
  std::vector<CompiledSet> sets;

  bool matches(const Symbol& symbol, const Kind& kind, std::uint32_t regions) const {
    constexpr std::uint8_t ends = bit(Letter::lamp) | bit(Letter::eye);
    const std::uint8_t letter = bit(symbol.letter);
    if (negated && (letter & ends) != 0) return false;
    const auto one = [&](const CompiledToken& token) {
      return (token.letters & letter) != 0 && (token.side == Side::none || token.side == symbol.side) &&
             (token.pattern == kAny || get(kind.patterns, token.pattern)) &&
             (token.region == kAny || (regions >> token.region & 1) != 0);
    };
    const bool any = std::any_of(tokens.begin(), tokens.end(), one) ||
                     std::any_of(sets.begin(), sets.end(), [&](const CompiledSet& inner) {
                       return inner.matches(symbol, kind, regions);
                     });
    return any != negated;
  }
  std::size_t token_count() const {
    std::size_t count = tokens.size();
    for (const CompiledSet& inner : sets) count += inner.token_count();
    return count;
  }
};

CompiledSet compiled(const Set& set, const std::vector<std::string>& patterns,
                     std::span<const std::string> regions) {
  const auto index = [](const auto& list, const std::string& text) {
    return text.empty() ? kAny
                        : static_cast<std::size_t>(std::find(list.begin(), list.end(), text) - list.begin());
  };
  CompiledSet result{set.negated, {}, {}};
  for (const Token& token : set.tokens)
    result.tokens.push_back(
        {token.letters, token.side, index(patterns, token.name), index(regions, token.region)});
  for (const Set& inner : set.sets) result.sets.push_back(compiled(inner, patterns, regions));
  return result;
}

// Adds the kind of each object to `kinds`, whose first is that of objects without a name that counts.
std::vector<std::uint32_t> sort_objects(std::span<const ObjectNames> objects,
                                        std::span<const std::uint8_t> uses,
                                        const std::vector<std::string>& patterns, std::vector<Kind>& kinds) {
  std::map<Bits, std::uint32_t> known{{kinds.front().patterns, 0}};
  std::vector<std::uint32_t> kind_of_object;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    Kind kind = kinds.front();
    for (const std::string& name : objects[i])
      for (std::size_t p = 0; p < patterns.size(); ++p)
        if (matches_pattern(patterns[p], name)) {
          set(kind.patterns, p);
          if (kind.example.empty()) kind.example = name;
        }
    const auto [found, is_new] = known.emplace(kind.patterns, static_cast<std::uint32_t>(kinds.size()));
    if (is_new) {
      kind.uses = 0;
      kinds.push_back(std::move(kind));
    }
    kinds[found->second].uses |= uses.empty() ? kLampObject | kSurfaceObject | kMediumObject : uses[i];
    kind_of_object.push_back(found->second);
  }
  return kind_of_object;
}

bool can_be(const Kind& kind, Letter letter) {
  if (letter == Letter::eye) return true;
  const ObjectUse use = letter == Letter::lamp     ? kLampObject
                        : letter == Letter::volume ? kMediumObject
                                                   : kSurfaceObject;
  return (kind.uses & use) != 0;
}

std::string example_of(const Symbol& symbol, const Kind& kind, std::uint32_t inside,
                       std::span<const std::string> regions) {
  std::string text(symbol.text);
  if (symbol.letter != Letter::eye && !kind.example.empty()) text += fmt::format("{{{}}}", kind.example);
  for (std::size_t r = 0; r < regions.size(); ++r)
    if ((inside >> r & 1) != 0) text += '@' + regions[r];
  return text;
}

}  // namespace

Result<Alphabet> Alphabet::make(std::span<const Set> atoms, std::span<const std::string> regions,
                                std::span<const ObjectNames> objects, std::span<const std::uint8_t> uses) {
  std::vector<std::string> patterns;
  for (const Set& atom : atoms)
    for_each_token(atom, [&](const Token& token) {
      if (!token.name.empty() && std::find(patterns.begin(), patterns.end(), token.name) == patterns.end())
        patterns.push_back(token.name);
    });

  Alphabet alphabet;
  alphabet.region_bits_ = static_cast<std::uint32_t>(regions.size());
  alphabet.region_mask_ = (1U << regions.size()) - 1;
  // A surface may lack an object; a lamp has one, and so has a medium.
  const std::uint8_t unnamed =
      uses.empty() ? kLampObject | kSurfaceObject | kMediumObject : std::uint8_t{kSurfaceObject};
  std::vector<Kind> kinds{{Bits(patterns.size() / 64 + 1), unnamed, {}}};
  alphabet.kinds_ = sort_objects(objects, uses, patterns, kinds);

  std::vector<CompiledSet> sets;
  std::uint64_t tokens = 1;
  for (const Set& atom : atoms) tokens += sets.emplace_back(compiled(atom, patterns, regions)).token_count();
  const std::uint64_t symbols = (kinds.size() * kSymbolCount) << regions.size();
  if (symbols > kMaxEvaluations / tokens)
    return input_error(
               fmt::format("the layers tell {} objects apart in {} regions by {} names, which is too many",
                           kinds.size(), regions.size(), patterns.size()))
        .with_mend("use fewer regions, or names with * that stand for many objects");

  std::map<std::pair<Place, Bits>, Class> known;
  alphabet.classes_.resize(symbols);
  for (std::size_t k = 0, next = 0; k < kinds.size(); ++k)
    for (const Symbol& symbol : kSymbolTable)
      for (std::uint32_t inside = 0; inside <= alphabet.region_mask_; ++inside, ++next) {
        const bool is_end = symbol.letter == Letter::lamp || symbol.letter == Letter::eye;
        // E has neither name nor region, L no region.
        const Kind& kind = symbol.letter == Letter::eye ? kinds.front() : kinds[k];
        const std::uint32_t where = is_end ? 0 : inside;
        Bits accepted(sets.size() / 64 + 1);
        for (std::size_t a = 0; a < sets.size(); ++a)
          if (sets[a].matches(symbol, kind, where)) set(accepted, a);
        const Place place = symbol.letter == Letter::lamp  ? Place::lamp
                            : symbol.letter == Letter::eye ? Place::eye
                                                           : Place::inner;
        const auto [found, is_new] =
            known.emplace(std::pair(place, std::move(accepted)), static_cast<Class>(known.size()));
        if (is_new) {
          if (known.size() > kMaxClasses)
            return input_error(
                       fmt::format("the layers tell more than {} kinds of vertices apart", kMaxClasses))
                .with_mend("use fewer names and regions");
          alphabet.places_.push_back(place);
          alphabet.possible_.push_back(0);
          alphabet.accepted_.push_back(found->first.second);
          alphabet.examples_.push_back(example_of(symbol, kind, where, regions));
        }
        const Class c = found->second;
        if (alphabet.possible_[c] == 0 && can_be(kind, symbol.letter)) {
          alphabet.possible_[c] = 1;
          alphabet.examples_[c] = example_of(symbol, kind, where, regions);
        }
        alphabet.classes_[next] = c;
      }
  return alphabet;
}

}  // namespace candela::letters
