// Text of layers of light path expressions: what is read, what is refused, and where.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <map>

#include "common/film/layout.h"
#include "common/job/layer_name.h"
#include "common/letters/automaton.h"
#include "common/letters/normal_form.h"
#include "common/letters/request.h"
#include "tests/random_draws.h"

namespace candela::letters {
namespace {

using test::Draws;

std::string fault(const std::string& expression) {
  const auto tree = parse_expression(expression);
  return tree.ok() ? "" : tree.error().to_string();
}

// Claim: every kind of fault has its column and its mend.
TEST(LettersRequest, FaultsHaveAColumnAndAMend) {
  for (const auto& [text, expected] : std::vector<std::pair<std::string, std::string>>{
           {"", "column 1: the expression is empty (L[DGSV]*E matches all paths)"},
           {"  ", "column 1: the expression is empty (L[DGSV]*E matches all paths)"},
           {"LQE", "column 2: 'Q' is no letter (letters are L, E, D, G, S, X and V)"},
           {"L é", "column 3: 'é' is no letter (letters are L, E, D, G, S, X and V)"},
           {"L(DE", "column 2: this '(' is not closed (write ')')"},
           {"LD)E", "column 3: ')' closes nothing (take it away, or write '(' before it)"},
           {"L[DE", "column 2: this '[' is not closed (write ']')"},
           {"L]E", "column 2: ']' closes nothing (take it away, or write '[' before it)"},
           {"L[]E", "column 2: the set is empty (write letters between [ and ])"},
           {"L[D(S)]E",
            "column 4: '(' is inside [ ], which matches one vertex (use ( | ) for alternatives of several "
            "vertices)"},
           {"L*+E", "column 3: '+' follows '*' (one is enough, or use parentheses)"},
           {"*LE", "column 1: '*' has nothing to repeat (write a letter before it)"},
           {"L RE", "column 3: L has no R (R and T stand behind D, G, S and X)"},
           {"LVTE", "column 3: V has no T (R and T stand behind D, G, S and X)"},
           {"L[X]RE", "column 5: R does not follow a letter (R and T stand behind D, G, S and X)"},
           {"L{aE", "column 2: this '{' is not closed (write '}')"},
           {"L{ }E", "column 2: the name is empty (write the name of an object, or no { })"},
           {"LX@ boxE", "column 3: no region follows '@' (write its name, which begins with a letter)"},
           {"L@boxE", "column 2: L has no region (D, G, S, X and V have)"},
           {"LXE{cam}", "column 4: E has no name (write E alone)"},
           {"L{a}{b}E", "column 5: '{' does not follow a letter (names and regions belong to a letter)"},
           {"LD\xff", "column 3: the byte is not UTF-8"}})
    EXPECT_EQ(fault(text), expected) << text;
  EXPECT_EQ(fault("L" + std::string(64, '(') + "D" + std::string(64, ')') + "E"), "");
  EXPECT_EQ(fault("L" + std::string(65, '(') + "D" + std::string(65, ')') + "E"),
            "column 66: parentheses are nested deeper than 64");
  EXPECT_EQ(fault("L" + std::string(65, '[') + "D" + std::string(65, ']') + "E"),
            "column 66: sets are nested deeper than 64");
  EXPECT_EQ(fault(std::string(2049, 'L')), "column 2049: the expression is longer than 2048 bytes");
}

// Claim: names are patterns with *, ? and escapes; a character of UTF-8 is one '?'.
TEST(LettersRequest, Patterns) {
  const auto matches = [](const char* pattern, const char* name) { return matches_pattern(pattern, name); };
  EXPECT_TRUE(matches("key*", "key") && matches("key*", "key_left") && !matches("key*", "a key"));
  EXPECT_TRUE(matches("*a*b", "xxaxbxab") && !matches("*a*b", "xxaxbxa"));
  EXPECT_TRUE(matches("a?c", "abc") && matches("a?c", "aéc") && !matches("a?c", "ac") && !matches("a?", "a"));
  EXPECT_TRUE(matches("a\\*", "a*") && !matches("a\\*", "ab") && matches("\\\\", "\\"));
  EXPECT_TRUE(matches("*", "") && matches("", "") && !matches("", "a"));
  for (const char* name : {"a*", "?", "b}c", " d ", "\\", "e\\*"}) {
    EXPECT_TRUE(matches_pattern(pattern_of(name), name)) << name;
    const auto tree = parse_expression("L{" + pattern_of(name) + "}E");
    ASSERT_TRUE(tree.ok()) << tree.error().to_string();
    EXPECT_TRUE(matches_pattern(tree->children[0].children[0].set.tokens[0].name, name)) << name;
  }
  EXPECT_FALSE(matches_pattern(pattern_of("a*"), "ab"));
}

// Claim: expressions that are written differently and read the same have one normal form; no two of those
// that mean something else do.
TEST(LettersRequest, NormalForms) {
  const std::vector<std::vector<std::string>> groups = {
      {"L[DGSV]*E", " L [V S G D]* E", "(L)([XV])*E", "L([DGSV]*)E", "L[[DG][SV]]*E", "L[DDGSV]*E"},
      {"L[DGSV]+E", "L[XV]+E"},
      {"L[DGSV]?E"},
      {"LXE", "L[SGD]E", "L(X|[DGS])E"},
      {"L[^D]E", "L[^DD]E"},
      {"L[DE]", "L[ED]"},
      {"LDE|LSE", "LSE|LDE", "(LSE|(LDE))"},
      {"L(DE|LS)E"},
      {"L(D|S)(D|S)E"},
      {"L(D|SD|S)E"},
      {"LDRE"},
      {"LDTE"},
      {"LD{a}E", "LD{ a }E"},
      {"LD{a b}E"},
      {"LD{ab}E"},
      {"LD@a E", "LD @a E"},
      {"LD{@a}E"},
      {"LD{a}@a E"},
      {"LD{" + std::string(90, 'n') + "a}E"},
      {"LD{" + std::string(90, 'n') + "b}E"},
      {"(LD)*E"},
      {"LD*E", "L(D)*E", "L(D*)E"},
      {"L(D*)*E"},
  };
  std::map<std::string, std::size_t> group_of;
  for (std::size_t g = 0; g < groups.size(); ++g)
    for (const std::string& text : groups[g]) {
      const auto tree = parse_expression(text);
      ASSERT_TRUE(tree.ok()) << text << ": " << tree.error().to_string();
      const auto [place, is_new] = group_of.emplace(normal_form(*tree), g);
      EXPECT_EQ(place->second, g) << text << " as " << groups[place->second][0];
      EXPECT_EQ(is_new, &text == groups[g].data()) << text << " as " << groups[g][0] << ": " << place->first;
    }
}

std::string read(const std::string& text) {
  const auto request = parse_layer_request(text);
  return request.ok() ? text_of(*request) : request.error().to_string();
}

// Claim: a request reads what it writes, in its own order, with every digit.
TEST(LettersRequest, RoundTrip) {
  const std::string text =
      "layer caustics=L[SG]*S[SG]*DX*E; layer key=L{key; \\} 1}[DGSV]*E; region "
      "box=box:-1,-2.5,0,1e+30,0.1,3; region "
      "ball=sphere:0.30000000000000004,0,1,2; glossy-below 0.25; light-groups; partition";
  EXPECT_EQ(read(text), text);
  const auto request = parse_layer_request(text);
  ASSERT_TRUE(request.ok());
  EXPECT_EQ(request->layers[1].text, "L{key; \\} 1}[DGSV]*E");
  EXPECT_EQ(request->regions[1].radius, 2);
  EXPECT_EQ(request->regions[1].low[0], 0.30000000000000004);
  EXPECT_EQ(request->glossy_below, 0.25);
  EXPECT_TRUE(request->light_groups && request->partition && !request->empty());
  EXPECT_EQ(read(" partition ;; layer  a = LE ;"), "layer a=LE; partition");
  EXPECT_EQ(read(""), "");
  EXPECT_TRUE(parse_layer_request(" ; ")->empty());
}

// Claim: what cannot be is refused before a scene is read, with what to write instead.
TEST(LettersRequest, Refusals) {
  for (const auto& [text, expected] : std::vector<std::pair<std::string, std::string>>{
           {"layer a", "'a' is no layer (write NAME=EXPR: caustics=LS+DE)"},
           {"layer 1=LE", "a layer cannot be called '1': it does not begin with a letter"},
           {"layer error=LE", "a layer cannot be called 'error': the error estimate has that name"},
           {"layer a=LE; layer a=LDE", "two layers are called 'a' (name them apart)"},
           {"layer a=L(E", "layer 'a', column 2: this '(' is not closed (write ')')"},
           {"layer a=LX@bx E; region box=box:0,0,0,1,1,1",
            "layer 'a', column 2: there is no region 'bx' (did you mean 'box'?)"},
           {"layer a=LX@boxXE; region box=box:0,0,0,1,1,1",
            "layer 'a', column 2: there is no region 'boxXE' (a space ends the name: @box ...)"},
           {"layer a=LX@b E",
            "layer 'a', column 2: there is no region 'b' (--region NAME=box:x0,y0,z0,x1,y1,z1 makes one)"},
           {"layer a=LE; region b=box:0,0,0,1,-1,1", "region 'b': 0 is above -1, the low corner comes first"},
           {"layer a=LE; region b=sphere:0,0,0,0", "region 'b': the radius 0 is not above 0"},
           {"layer a=LE; glossy-below -1", "'-1' is no roughness of at least 0 (the default is 0.3)"},
           {"partition",
            "regions, glossy-below and partition belong to layers, and there is none (add --layer "
            "NAME=EXPR or --light-groups)"},
           {"light-group",
            "'light-group' asks for no layer (write layer NAME=EXPR, region NAME=box:..., glossy-below "
            "NUMBER, light-groups or partition)"}})
    EXPECT_EQ(read(text), expected) << text;
  for (const char* region :
       {"b", "b=cube:1,2,3,4", "b=box:0,0,0,1,1", "b=box:0,0,0,1,1,1,1", "b=sphere:0,0,0,nan",
        "b=sphere:0,0,0,1e999", "b=sphere:0,0,0,", "b=sphere", "1b=sphere:0,0,0,1", "=sphere:0,0,0,1"})
    EXPECT_FALSE(parse_region(region).ok()) << region;
}

// Claim: the numbers of layers, regions and bytes have bounds, and one at the bound is taken.
TEST(LettersRequest, Caps) {
  const auto layers = [](std::size_t count) {
    std::string text;
    for (std::size_t i = 0; i < count; ++i) text += fmt::format("layer a{}=LE;", i);
    return text;
  };
  EXPECT_TRUE(parse_layer_request(layers(film::kMaxLayers - 1)).ok());
  EXPECT_TRUE(read(layers(film::kMaxLayers)).starts_with("there are 64 layers of expressions, more than 63"));
  const auto regions = [](int count) {
    std::string text = "layer a=LE;";
    for (int i = 0; i < count; ++i) text += fmt::format("region r{}=sphere:0,0,0,1;", i);
    return text;
  };
  EXPECT_TRUE(parse_layer_request(regions(8)).ok());
  EXPECT_EQ(read(regions(9)), "there are 9 regions, more than 8");
  EXPECT_EQ(read(std::string(16385, ' ')), "the layers have 16385 bytes of text, more than 16384");
  // The longer text that is written counts as well.
  std::string dense;
  for (int i = 0; i < 8; ++i)
    dense += fmt::format("layer a{}=LE|{};", i, std::string(i < 7 ? 2040 : 1992, ' ') + "D");
  EXPECT_EQ(dense.size(), 16384U);
  EXPECT_EQ(read(dense), "the layers have 16390 bytes of text, more than 16384");
}

// Claim: any name of a lamp makes a layer's name, and different names make different ones.
TEST(LettersRequest, LightGroups) {
  LayerRequest request;
  request.layers = {{"light.key", "LE"}};
  request.light_groups = true;
  const std::vector<std::string> lamps = {
      "key", "a b", "a_b", "", "..x.", "é", "area.1", "key", std::string(300, 'n'), std::string(301, 'n')};
  const LayerRequest expanded = expand_light_groups(request, lamps);
  std::vector<std::string> names;
  for (const NamedExpression& layer : expanded.layers) {
    EXPECT_EQ(fault_of_layer_name(layer.name), "") << layer.name;
    names.push_back(layer.name);
  }
  const std::string longest = "light." + std::string(54, 'n');
  EXPECT_EQ(names,
            (std::vector<std::string>{"light.key", "light.key_2", "light.a_b", "light.a_b_2", "light._",
                                      "light._.x._", "light.__", "light.area.1", longest, longest + "_2"}));
  EXPECT_EQ(expanded.layers[2].text, "L{a\\ b}[DGSV]*E");
  EXPECT_FALSE(expanded.light_groups);
  EXPECT_EQ(expand_light_groups(expanded, lamps), expanded);
}

// Claim: random bytes and random changes of expressions make an error with a column, or an automaton; none
// crashes or takes long.
TEST(LettersRequest, Fuzz) {
  const std::vector<ObjectNames> objects = {{"a"}, {"wall"}, {"lamp"}, {}};
  const std::string letters = "LEDGSXVRT{}@[]^()|*+? ab\\";
  const std::vector<std::string> seeds = {"L[SG]*S[SG]*DX*E", "LDR{wall}X@box X*E",
                                          "L{lamp}[^D V@box]+(D|G?)*E", "LX*D XXXXX E"};
  Draws draws(5);
  int compiled = 0, refused = 0;
  const auto compile = [&](std::string expression) {
    LayerRequest request;
    request.layers = {{"a", std::move(expression)}};
    request.regions = {{"box", Region::Kind::box, {}, {}, 0}};
    const auto automaton = Automaton::compile(request, objects);
    if (automaton.ok()) {
      ++compiled;
      EXPECT_LE(automaton->counts().table, 1024U * 1024U);
      return;
    }
    ++refused;
    const std::string& why = automaton.error().message;
    EXPECT_TRUE(why.starts_with("layer 'a', column ") || why == "layer 'a' matches no path" ||
                why == "layer 'a' needs more than 1024 states")
        << why << " of " << request.layers[0].text;
  };
  for (int i = 0; i < 3000; ++i) {
    std::string text;
    for (std::uint64_t n = draws.below(40); n > 0; --n)
      text += i % 2 == 0 ? static_cast<char>(draws.below(256)) : letters[draws.below(letters.size())];
    compile(std::move(text));
    std::string changed = seeds[draws.below(seeds.size())];
    for (std::uint64_t n = 1 + draws.below(4); n > 0; --n) {
      const std::size_t at = draws.below(changed.size() + 1);
      const char c = letters[draws.below(letters.size())];
      if (draws.below(3) == 0)
        changed.insert(at, 1, c);
      else if (at < changed.size() && draws.below(2) == 0)
        changed[at] = c;
      else if (at < changed.size())
        changed.erase(at, 1 + draws.below(3));
    }
    compile(std::move(changed));
    // The text of a request, which comes from peers.
    std::string request = "layer a=LX@b E; region b=box:0,0,0,1,1,1; glossy-below 0.2; partition";
    for (std::uint64_t n = 1 + draws.below(4); n > 0; --n)
      request[draws.below(request.size())] = static_cast<char>(draws.below(128));
    if (const auto parsed = parse_layer_request(request); parsed.ok()) {
      EXPECT_EQ(parse_layer_request(text_of(*parsed)).value(), *parsed) << request;
    }
  }
  EXPECT_GT(compiled, 100);
  EXPECT_GT(refused, 2000);
}

// Claim: the largest expressions that the grammar takes are compiled or refused within bounds.
TEST(LettersRequest, LargeExpressions) {
  const auto compile = [](const std::string& text, int layers, int objects) {
    LayerRequest request;
    for (int i = 0; i < layers; ++i) request.layers.push_back({fmt::format("a{}", i), text});
    for (int i = 0; i < 8; ++i)
      request.regions.push_back({fmt::format("r{}", i), Region::Kind::box, {}, {}, 0});
    std::vector<ObjectNames> names;
    for (int i = 0; i < objects; ++i) names.push_back({fmt::format("n{}", i)});
    const auto automaton = Automaton::compile(request, names);
    return automaton.ok() ? "" : automaton.error().message;
  };
  const std::string stars = "L(" + std::string(600, 'D') + "(" + std::string(601, 'D') + ")*)*E";
  EXPECT_EQ(compile(stars, 1, 0), "layer 'a0' needs more than 1024 states");
  EXPECT_EQ(compile("L" + std::string(2046, 'D') + "E", 1, 0), "layer 'a0' needs more than 1024 states");
  EXPECT_EQ(compile("L" + std::string(1000, 'D') + "E", 5, 0),
            "layer 'a4' and those before it have more than 4096 letters");
  std::string options = "L";
  for (int i = 0; i < 900; ++i) options += i % 2 == 0 ? "D?" : "G?";
  EXPECT_EQ(compile(options + "E", 1, 0), "");
  std::string nested = "D*";
  for (int i = 0; i < 60; ++i) nested = "(" + nested + "|G)*";
  EXPECT_EQ(compile("L" + nested + "E", 1, 0), "");
  std::string names = "L";
  for (int i = 0; i < 190; ++i) names += fmt::format("X{{n{}}}@r{} ", i, i % 8);
  EXPECT_EQ(compile(names + "E", 1, 200),
            "the layers tell 191 objects apart in 8 regions by 190 names, which is too many");
}

}  // namespace
}  // namespace candela::letters
