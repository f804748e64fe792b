// The automaton of light path expressions against a matcher without automata, and its sizes.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <sstream>

#include "common/letters/automaton.h"
#include "tests/paths.h"
#include "tests/random_draws.h"
#include "tests/unit/letters_matcher.h"

namespace candela::letters {
namespace {

using test::Draws;
using test::Matcher;
using test::PathVertex;

struct Problem {
  LayerRequest request;
  std::vector<ObjectNames> objects;
  std::vector<Node> trees;
};

// Its objects are the names in the expressions, without wildcards, and one more; its regions are those after
// '@'.
Problem problem_of(const std::vector<std::string>& expressions) {
  Problem problem;
  std::set<std::string> names, regions;
  for (const std::string& text : expressions) {
    problem.request.layers.push_back({fmt::format("e{}", problem.request.layers.size()), text});
    auto tree = parse_expression(text);
    if (!tree.ok()) throw std::runtime_error(text + ": " + tree.error().message);
    for_each_token(*tree, [&](const Token& token) {
      if (!token.name.empty()) names.insert(token.name);
      if (!token.region.empty()) regions.insert(token.region);
    });
    problem.trees.push_back(std::move(*tree));
  }
  for (std::string name : names) {
    std::erase(name, '*');
    problem.objects.push_back({"material", std::move(name)});
  }
  for (const std::string& name : regions)
    problem.request.regions.push_back({name, Region::Kind::box, {}, {}, 0});
  return problem;
}

// A vertex with the numbers that class_of() takes.
struct Drawn {
  PathVertex vertex;
  std::uint32_t object = kNoObject, regions = 0;
};

Drawn draw(const Problem& problem, Draws& draws, Letter letter) {
  Drawn drawn;
  drawn.vertex.letter = letter;
  if (letter == Letter::diffuse || letter == Letter::glossy || letter == Letter::specular)
    drawn.vertex.side = draws.below(2) == 0 ? Side::reflected : Side::transmitted;
  drawn.object = static_cast<std::uint32_t>(draws.below(problem.objects.size() + 1));
  if (drawn.object < problem.objects.size() && letter != Letter::eye)
    drawn.vertex.names = problem.objects[drawn.object];
  else
    drawn.object = kNoObject;
  for (std::size_t r = 0; r < problem.request.regions.size(); ++r)
    if (draws.below(2) == 0) {
      drawn.regions |= 1U << r;
      drawn.vertex.regions.insert(problem.request.regions[r].name);
    }
  return drawn;
}

// L ... E most of the time, anything else sometimes.
std::vector<Drawn> draw_string(const Problem& problem, Draws& draws) {
  std::vector<Drawn> string;
  const bool is_path = draws.below(5) != 0;
  const std::size_t length = draws.below(10);
  if (is_path) string.push_back(draw(problem, draws, Letter::lamp));
  for (std::size_t i = 0; i < length; ++i)
    string.push_back(
        draw(problem, draws, static_cast<Letter>(is_path ? 2 + draws.below(4) : draws.below(6))));
  if (is_path) string.push_back(draw(problem, draws, Letter::eye));
  return string;
}

std::vector<std::uint8_t> matched_by(const Problem& problem, const std::vector<Drawn>& string) {
  std::vector<PathVertex> path;
  for (const Drawn& drawn : string) path.push_back(drawn.vertex);
  std::vector<std::uint8_t> layers;
  for (std::size_t i = 0; i < problem.trees.size(); ++i)
    if (Matcher::matches(problem.trees[i], path)) layers.push_back(static_cast<std::uint8_t>(i));
  return layers;
}

// Ways in which an estimator joins the two walks; the wrong ways are planted.
enum class Join { right, reverse_reads_from_vertex, state_after_vertex };

struct Agreement {
  int disagreements = 0, matches = 0, others = 0;
};

// Every split of every string: the forward state of the prefix and the reverse state of the suffix have the
// label that the matcher finds.
Agreement compare(const Problem& problem, int strings, std::uint64_t seed, Join join = Join::right) {
  Agreement result;
  const auto compiled = Automaton::compile(problem.request, problem.objects);
  EXPECT_TRUE(compiled.ok()) << compiled.error().to_string();
  if (!compiled.ok()) return result;
  const Automaton& automaton = *compiled;
  Draws draws(seed);
  for (int i = 0; i < strings; ++i) {
    const std::vector<Drawn> string = draw_string(problem, draws);
    const std::vector<std::uint8_t> expected = matched_by(problem, string);
    ++(expected.empty() ? result.others : result.matches);
    std::vector<Automaton::Class> classes;
    for (const Drawn& v : string)
      classes.push_back(automaton.class_of(v.vertex.letter, v.vertex.side, v.object, v.regions));
    for (std::size_t split = 0; split <= string.size(); ++split) {
      Automaton::State q = automaton.forward_start(), r = automaton.reverse_before_eye();
      const std::size_t prefix = split + (join == Join::state_after_vertex && split < string.size() ? 1 : 0);
      for (std::size_t k = 0; k < prefix; ++k) q = automaton.forward(q, classes[k]);
      if (join == Join::reverse_reads_from_vertex)
        for (std::size_t k = split; k < string.size(); ++k) r = automaton.reverse(r, classes[k]);
      else
        for (std::size_t k = string.size(); k > split; --k) r = automaton.reverse(r, classes[k - 1]);
      const auto layers = automaton.layers(automaton.label(q, r));
      if (!std::equal(layers.begin(), layers.end(), expected.begin(), expected.end())) ++result.disagreements;
      if (split + 1 == string.size() && string.back().vertex.letter == Letter::eye) {
        EXPECT_EQ(automaton.reverse(automaton.reverse_before_eye(), classes.back()),
                  automaton.reverse_start());
      }
    }
  }
  return result;
}

const std::vector<std::vector<std::string>> kRows = {
    {"LX*E"},
    {"L[SG]*S[SG]*DX*E"},
    {"LX*DST+E"},
    {"L{lamp}X*E"},
    {"LDR{wall}X@box X*E"},
    {"L ST GR{car} X* E"},
    {"LX*SR{mirror}X*E"},
    {"LX*DR{wall}X*DR{wall}X*E"},
    {"LX*GGX*E"},
    {"LX*X@box XXE"},
    {"LX*D XXXXX E"},
    {"L[XV]*V[XV]*E"},
    {"L{a}[XV]*E", "L{b}[XV]*E", "L{-}[XV]*E"},
    {"LE", "L[XV]*DE", "L[XV]*GE", "L[XV]*SE", "L[XV]*VE"},
    {"LE", "LDE", "LGE", "LSE", "LXX+E", "LX*VE", "L[XV]*V[XV]*XE", "L[SG]+D[XV]*E"},
    {"L[^D]*E", "L[^ST V@a]+[^[^G]D{x}]?E"},
    {"L((X?)*|(V+)*)*E", "L(D|GS|)(V|)E|LE"},
    {"L{key*}[DGSV]*E", "L[^X{wall*}]*E", "LX{wall}@a[X@b V@a]*E"},
};

// Claim: forward states, reverse states and labels are those of a matcher that knows no automaton, at every
// split of 3,000 random strings for each row.
TEST(LettersAutomaton, EverySplitOfRandomStrings) {
  for (const auto& row : kRows) {
    const Agreement found = compare(problem_of(row), 3000, 17);
    EXPECT_EQ(found.disagreements, 0) << row.front();
    EXPECT_GT(found.matches, 5) << row.front();
    EXPECT_GT(found.others, 5) << row.front();
  }
}

// Claim: the comparison sees a suffix that is read from the vertex instead of from the eye, and a forward
// state that has read the vertex where two walks meet.
TEST(LettersAutomaton, PlantedErrorsAreSeen) {
  const Problem caustics = problem_of({"L[SG]*S[SG]*DX*E"});
  EXPECT_GT(compare(caustics, 1000, 17, Join::reverse_reads_from_vertex).disagreements, 100);
  EXPECT_GT(compare(caustics, 1000, 17, Join::state_after_vertex).disagreements, 50);
}

// ---- random expressions ----

std::string random_expression(Draws& draws, int depth) {
  static constexpr std::array<const char*, 18> tokens = {
      "D",    "G",   "S",        "X",    "V",    "XR",       "ST",        "D{a}",     "X{b*}",
      "V{a}", "X@r", "GR{b1}@r", "[DV]", "[^D]", "[^X@r V]", "[SR V{a}]", "[^[^G]S]", "X"};
  static constexpr std::array<const char*, 7> repeats = {"", "", "", "", "*", "+", "?"};
  std::string text;
  for (std::uint64_t i = 0, n = 1 + draws.below(4); i < n; ++i) {
    if (depth > 0 && draws.below(4) == 0)
      text += "(" + random_expression(draws, depth - 1) + (draws.below(2) == 0 ? "|" : "") +
              random_expression(draws, depth - 1) + ")";
    else
      text += tokens[draws.below(tokens.size())];
    text += std::string(repeats[draws.below(repeats.size())]) + " ";
  }
  return depth == 2 && draws.below(3) == 0 ? text + "|" + random_expression(draws, 1) : text;
}

// Claim: the same for tuples of random expressions with names, wildcards, regions, negated sets, nested
// repeats and empty alternatives.
TEST(LettersAutomaton, RandomExpressions) {
  Draws draws(23);
  int compiled = 0;
  for (int i = 0; i < 100; ++i) {
    std::vector<std::string> expressions;
    for (std::uint64_t n = 1 + draws.below(3); n > 0; --n)
      expressions.push_back("L(" + random_expression(draws, 2) + ")E");
    Problem problem = problem_of(expressions);
    problem.objects = {{"a"}, {"b1"}, {"m", "b2"}, {}};
    problem.request.regions = {{"r", Region::Kind::box, {}, {}, 0}};
    const auto automaton = Automaton::compile(problem.request, problem.objects);
    if (!automaton.ok()) {
      // The one fault that they can have.
      EXPECT_NE(automaton.error().message.find("states"), std::string::npos) << automaton.error().to_string();
      continue;
    }
    ++compiled;
    EXPECT_EQ(compare(problem, 60, static_cast<std::uint64_t>(i)).disagreements, 0) << expressions.front();
  }
  EXPECT_GT(compiled, 80);
}

// ---- sizes ----

std::vector<std::string> split(const std::string& text, const std::string& by) {
  std::vector<std::string> parts;
  std::size_t begin = 0;
  for (std::size_t end; (end = text.find(by, begin)) != std::string::npos; begin = end + by.size())
    parts.push_back(text.substr(begin, end - begin));
  parts.push_back(text.substr(begin));
  return parts;
}

// Claim: classes, states and table entries are those of the theory's table.
TEST(LettersAutomaton, SizesAreThoseOfTheTheory) {
  std::ifstream file(test::shared_path() / "theory" / "retargeting.csv");
  if (!file) GTEST_SKIP() << "no retargeting.csv in " << test::shared_path() / "theory";
  int rows = 0;
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with("lpe ") && !line.starts_with("\"lpe ")) continue;
    if (line.front() == '"') line = "lpe" + line.substr(line.find('"', 1) + 1);  // a comma is in its name
    const std::vector<std::string> fields = split(line, ",");
    const auto automaton = [&] {
      const Problem problem = problem_of(split(fields[1], " ; "));
      std::vector<ObjectNames> objects = problem.objects;
      for (ObjectNames& names : objects) names.erase(names.begin());
      return Automaton::compile(problem.request, objects);
    }();
    ASSERT_TRUE(automaton.ok()) << automaton.error().to_string();
    Automaton::Counts c = automaton->counts();
    // Lamps without a name are those called '-' there, and one class more here.
    if (fields[1].find("{-}") != std::string::npos) --c.classes;
    EXPECT_EQ(
        fmt::format("{},{},{},{},{},{}", c.classes, c.nfa, c.dfa, c.minimal, c.reverse, c.table),
        fmt::format("{},{},{},{},{},{}", fields[3], fields[4], fields[5], fields[6], fields[7], fields[8]))
        << line;
    ++rows;
  }
  EXPECT_EQ(rows, 15);
}

std::string error_of(const std::vector<std::string>& expressions,
                     const std::vector<ObjectNames>& objects = {}, const std::vector<std::uint8_t>& uses = {},
                     bool partition = false) {
  LayerRequest request;
  for (const std::string& text : expressions)
    request.layers.push_back({fmt::format("e{}", request.layers.size()), text});
  request.partition = partition;
  const auto automaton = Automaton::compile(request, objects, uses);
  return automaton.ok() ? "" : automaton.error().to_string();
}

// Claim: an expression that needs too many states is named, forward and reverse, alone and with others.
TEST(LettersAutomaton, TooManyStates) {
  const std::string from_eye = "LX*D XXXXXXXXXXXX E", from_light = "L XXXXXXXXXXXX DX*E";
  EXPECT_EQ(error_of({"LX*D XXXXXXX E"}), "");
  EXPECT_EQ(error_of({"LE", from_eye}),
            "layer 'e1' needs more than 1024 states (count vertices from one end alone, or write fewer of "
            "them behind "
            "a *)");
  // Its reverse is the large one.
  EXPECT_TRUE(error_of({"LE", from_light}).starts_with("layer 'e1' needs more than 1024 states"));
  // The last seven letters: 2^7 states for one expression, 3^7 for two.
  EXPECT_EQ(error_of({"LX*D XXXXXX E"}), "");
  EXPECT_EQ(error_of({"LX*D XXXXXX E", "LX*G XXXXXX E"}),
            "layer 'e0' and the others together need more than 1024 states (ask for fewer layers at once)");
}

// Claim: names that no object has are refused with the nearest, and with the kind of object that the letter
// needs.
TEST(LettersAutomaton, UnknownNames) {
  const std::vector<ObjectNames> objects = {{"lamp_1", "paint"}, {"wall", "paint"}, {"fog"}};
  const std::vector<std::uint8_t> uses = {kLampObject | kSurfaceObject, kSurfaceObject, kMediumObject};
  EXPECT_EQ(error_of({"LE", "L{lmap_1}[DGSV]*E"}, objects),
            "layer 'e1', column 1: no object is called 'lmap_1' (did you mean 'lamp_1'?)");
  EXPECT_EQ(error_of({"L X*[V D{zz*}]E"}, objects),
            "layer 'e0', column 8: no object is called 'zz*' (`candela objects SCENE` lists the names)");
  EXPECT_EQ(error_of({"L{wall}E"}, objects), "");
  EXPECT_EQ(error_of({"L{wall}E"}, objects, uses),
            "layer 'e0', column 1: no lamp is called 'wall' (objects of that name are no lamp)");
  EXPECT_EQ(error_of({"LV{wall}E"}, objects, uses),
            "layer 'e0', column 2: no medium is called 'wall' (objects of that name are no media)");
  EXPECT_EQ(error_of({"LX{fog}E"}, objects, uses),
            "layer 'e0', column 2: no surface is called 'fog' (objects of that name are no surface)");
  EXPECT_EQ(error_of({"L{lamp_?}X{paint}V{f*}X{lamp_1}E"}, objects, uses), "");
}

// Claim: an expression that matches no path at all is refused, and one whose vertices this scene lacks is
// not.
TEST(LettersAutomaton, EmptyClasses) {
  EXPECT_TRUE(error_of({"LE", "X*E"}).starts_with("layer 'e1' matches no path (a path begins with L"));
  EXPECT_TRUE(error_of({"L[^XV]E"}).starts_with("layer 'e0' matches no path"));
  EXPECT_TRUE(error_of({"LLE"}).starts_with("layer 'e0' matches no path"));
  EXPECT_EQ(error_of({"L[^XV]*E"}), "");
  EXPECT_EQ(error_of({"LX*VE"}, {{"wall"}}, {kSurfaceObject}), "");
}

// ---- partitions ----

// Claim: the verdicts on known partitions and on what is none, with a path that shows why.
TEST(LettersAutomaton, Partitions) {
  EXPECT_EQ(error_of({"LE", "L[XV]*DE", "L[XV]*GE", "L[XV]*SE", "L[XV]*VE"}, {}, {}, true), "");
  EXPECT_EQ(error_of({"L[DGSV]*E"}, {}, {}, true), "");
  EXPECT_EQ(error_of({"LX*E"}, {}, {}, true),
            "the layers are no partition: none matches the path L V E (add a layer that does, or leave "
            "--partition out)");
  // A scene whose objects are known has no media but those.
  const std::vector<ObjectNames> without_media = {{"lamp"}, {"wall"}};
  EXPECT_EQ(error_of({"LX*E"}, without_media, std::vector<std::uint8_t>{kLampObject, kSurfaceObject}, true),
            "");
  EXPECT_EQ(error_of({"L[XV]*E", "LV?D+E"}, {}, {}, true),
            "the layers are no partition: 'e0' and 'e1' both match the path L DR E (narrow one of the two, "
            "or leave "
            "--partition out)");
  // Lamps: only those are lamps that the scene has as such.
  const std::vector<ObjectNames> objects = {{"a"}, {"b"}, {"wall"}};
  const std::vector<std::string> by_lamp = {"L{a}[XV]*E", "L{b}[XV]*E"};
  EXPECT_EQ(error_of(by_lamp, objects, {kLampObject | kSurfaceObject, kLampObject, kSurfaceObject}, true),
            "");
  EXPECT_EQ(error_of(by_lamp, objects, {}, true),
            "the layers are no partition: none matches the path L E (add a layer that does, or leave "
            "--partition out)");
  EXPECT_EQ(error_of({"L{a}[XV]*E"}, objects, {kLampObject, kLampObject, kSurfaceObject}, true),
            "the layers are no partition: none matches the path L E (add a layer that does, or leave "
            "--partition out)");
}

// The path of a message, "L DR E".
std::vector<PathVertex> path_of(const std::string& text) {
  static const std::string letters = "LEDGSV";
  std::vector<PathVertex> path;
  std::istringstream words(text);
  for (std::string word; words >> word;)
    path.push_back({static_cast<Letter>(letters.find(word[0])),
                    word.size() < 2  ? Side::none
                    : word[1] == 'R' ? Side::reflected
                                     : Side::transmitted,
                    {},
                    {}});
  return path;
}

// Claim: on random layers the verdict on a partition is that of the matcher: a path named as an example shows
// it, and layers that pass have no such path of up to four vertices between L and E.
TEST(LettersAutomaton, RandomPartitions) {
  static constexpr std::array<const char*, 10> parts = {"",     "X",  "V",      "[XV]*", "D",
                                                        "[^D]", "D?", "[XV]*D", "[^D]*", "S+"};
  std::vector<std::vector<PathVertex>> paths;
  for (int length = 0; length <= 4; ++length)
    for (int code = 0; code < 1 << (2 * length); ++code) {
      std::vector<PathVertex> path{{Letter::lamp, Side::none, {}, {}}};
      for (int i = 0; i < length; ++i)
        path.push_back({static_cast<Letter>(2 + (code >> (2 * i) & 3)), Side::none, {}, {}});
      path.push_back({Letter::eye, Side::none, {}, {}});
      paths.push_back(std::move(path));
    }
  Draws draws(31);
  int partitions = 0, refused = 0;
  const auto count = [](const std::vector<Node>& trees, const std::vector<PathVertex>& path) {
    return std::count_if(trees.begin(), trees.end(),
                         [&](const Node& tree) { return Matcher::matches(tree, path); });
  };
  for (int i = 0; i < 1000; ++i) {
    std::vector<std::string> expressions;
    std::vector<Node> trees;
    for (std::uint64_t n = 1 + draws.below(3); n > 0; --n) {
      expressions.push_back(
          fmt::format("L{}{}E", parts[draws.below(parts.size())], parts[draws.below(parts.size())]));
      trees.push_back(*parse_expression(expressions.back()));
    }
    const std::string error = error_of(expressions, {}, {}, true);
    if (error.empty()) {
      ++partitions;
      for (const auto& path : paths) ASSERT_EQ(count(trees, path), 1) << expressions.front();
    } else {
      ++refused;
      const std::size_t begin = error.find("the path ") + 9;
      ASSERT_LT(begin, error.size()) << error;
      EXPECT_NE(count(trees, path_of(error.substr(begin, error.find(" (") - begin))), 1) << error;
    }
  }
  EXPECT_GT(partitions, 15);
  EXPECT_GT(refused, 300);
}

// Claim: a light group for each lamp is a partition.
TEST(LettersAutomaton, LightGroupsArePartitions) {
  LayerRequest request;
  request.light_groups = request.partition = true;
  const std::vector<std::string> lamps = {"key", "fill*", "key", "fill", "area.1"};
  std::vector<ObjectNames> objects;
  for (const std::string& name : lamps) objects.push_back({name});
  const std::vector<std::uint8_t> uses(objects.size(), kLampObject);
  EXPECT_FALSE(Automaton::compile(request, objects, uses).ok());
  const LayerRequest expanded = expand_light_groups(request, lamps);
  ASSERT_EQ(expanded.layers.size(), 4U);
  const auto automaton = Automaton::compile(expanded, objects, uses);
  ASSERT_TRUE(automaton.ok()) << automaton.error().to_string();
  for (std::uint32_t i = 0; i < lamps.size(); ++i) {
    const auto q =
        automaton->forward(automaton->forward_start(), automaton->class_of(Letter::lamp, Side::none, i, 0));
    const auto layers = automaton->layers(automaton->label(q, automaton->reverse_start()));
    ASSERT_EQ(layers.size(), 1U);
    EXPECT_EQ(layers[0], (std::array{0, 1, 0, 2, 3}[i]));
  }
}

}  // namespace
}  // namespace candela::letters
