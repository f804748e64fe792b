// The text of edits: what is read, what is refused and how, and which vertices an expression selects.
#include <gtest/gtest.h>

#include <string>

#include "common/edits/edits.h"
#include "common/edits/path_states.h"
#include "common/edits/selection.h"
#include "common/rng/stream.h"

namespace candela::edits {
namespace {

const std::string kWhole = R"({
  "regions": {"pool": {"box": [0, 0, 0, 1, 2, 4]}, "ball": {"sphere": [1, 2, 3, 0.5]}},
  "glossy_below": 0.2,
  "edits": [
    {"name": "caustic", "direction": "light", "select": "LX*S{glass}", "source": "pool",
     "hit": true,
     "move": {"to": [5, 6, 7], "stretch": [1, 2, 1], "normal": [0, 0, 1]}},
    {"name": "turn", "direction": "eye", "select": "SR{mirror}X*E", "rotate": {"axis": [0, 1, 0], "degrees": 20},
     "scale": 0.5, "tint": [1, 0.5, 0]}
  ]})";

std::string error_of(const std::string& text) {
  const auto list = parse_edits(text);
  return list.ok() ? std::string("none") : list.error().to_string();
}
// With one edit, which has these members beside a name, a direction and an expression.
std::string edit(const std::string& members) {
  return R"({"regions": {"r": {"sphere": [0, 0, 0, 1]}}, "edits": [{"name": "a", "direction": "light", "select": "LX*X")" +
         members + "}]}";
}

// Claim: every key arrives, `from` is the middle of the source, and the text written is read as the same.
TEST(EditText, IsReadAndWritten) {
  const auto list = parse_edits(kWhole);
  ASSERT_TRUE(list.ok()) << list.error().to_string();
  ASSERT_EQ(list->edits.size(), 2u);
  const Edit& caustic = list->edits[0];
  EXPECT_EQ(caustic.direction, Edit::Direction::light);
  EXPECT_EQ(caustic.select, "LX*S{glass}");
  EXPECT_TRUE(caustic.hit);
  EXPECT_EQ(caustic.move->from, (Triple{0.5, 1, 2}));
  EXPECT_EQ(caustic.move->to, (Triple{5, 6, 7}));
  EXPECT_EQ(caustic.move->linear, (std::array<double, 9>{1, 0, 0, 0, 2, 0, 0, 0, 1}));
  const Edit& turn = list->edits[1];
  EXPECT_EQ(turn.factor, (Triple{0.5, 0.25, 0}));
  EXPECT_EQ(turn.rotate->degrees, 20);
  EXPECT_FALSE(turn.hit);
  EXPECT_EQ(list->glossy_below, 0.2);
  const auto again = parse_edits(text_of(*list));
  ASSERT_TRUE(again.ok()) << again.error().to_string();
  EXPECT_EQ(*again, *list);
  EXPECT_EQ(text_of(*list).find('\n'), std::string::npos);
}

// Claim: edits that change nothing are not there; an edit that does anything is.
TEST(EditText, LosesWhatChangesNothing) {
  for (const char* same :
       {"", R"(, "scale": 1)", R"(, "rotate": {"axis": [1, 0, 0], "degrees": 0})",
        R"(, "move": {"from": [1, 2, 3], "to": [1, 2, 3]})", R"(, "source": "r", "move": {})"})
    EXPECT_EQ(text_of(*parse_edits(edit(same))), "") << same;
  for (const char* other : {R"(, "scale": 0.99)", R"(, "rotate": {"axis": [1, 0, 0], "degrees": 1e-9})",
                            R"(, "move": {"from": [1, 2, 3], "to": [1, 2, 3.001]})",
                            R"(, "source": "r", "move": {"stretch": [1, 1, 1.001]})"})
    EXPECT_EQ(parse_edits(edit(other))->edits.size(), 1u) << other;
  EXPECT_TRUE(parse_edits("")->empty());
}

// Claim: each fault is an error that names the key.
TEST(EditText, NamesTheKeyOfAFault) {
  const std::pair<std::string, std::string> faults[] = {
      {"{", "line 1"},
      {"{\n\"edits\": [}", "line 2"},
      {"[]", "no object"},
      {"{}", "edits"},
      {R"({"edit": []})", "did you mean 'edits'"},
      {R"({"edits": [], "edits": []})", "twice"},
      {R"({"edits": [{"name": "a"}]})", R"(edits[0].direction: it is missing (write "light" or "eye"))"},
      {R"({"edits": [{"name": "a", "direction": "eye"}]})",
       "edits[0].select: it is missing (write a light path expression"},
      {R"({"edits": [{"name": "1a", "direction": "eye", "select": "XX*E"}]})", "edits[0].name"},
      {R"({"edits": [{"name": "a", "direction": "up", "select": "XX*E"}]})", "edits[0].direction"},
      {R"({"edits": [{"name": "a", "direction": "eye", "select": "X)X*E"}]})", "column 2"},
      {edit(R"(, "source": "s")"), "edits[0].source"},
      {edit(R"(, "moves": {})"), "did you mean 'move'"},
      {edit(R"(, "hit": true)"), "edits[0].hit: there is no source"},
      {edit(R"(, "source": "r", "hit": 1)"), "edits[0].hit: it is neither true nor false"},
      {R"({"regions": {"r": {"box": [0, 0, 0, 0, 1, 0]}}, "edits": []})", "regions.r.box: the box is a line"},
      {edit(R"(, "move": {"to": [1, 2, 3]})"), "edits[0].move.from"},
      {edit(R"(, "move": {"from": [1, 2], "to": [1, 2, 3]})"), "edits[0].move.from: it has 2 entries"},
      {edit(R"(, "move": {"from": [1, 2, "x"]})"), "edits[0].move.from[2]"},
      {edit(R"(, "source": "r", "move": {"stretch": [1, 0, 1]})"), "singular"},
      {edit(R"(, "source": "r", "move": {"linear": [1, 2, 3, 2, 4, 6, 0, 0, 1]})"), "singular"},
      {edit(R"(, "source": "r", "move": {"normal": [0, 0, 0]})"), "edits[0].move.normal"},
      {edit(R"(, "source": "r", "move": {}, "rotate": {"axis": [1, 0, 0], "degrees": 1})"), "exclude"},
      {edit(R"(, "rotate": {"axis": [0, 0, 0], "degrees": 1})"), "edits[0].rotate.axis"},
      {edit(R"(, "rotate": {"axis": [1, 0, 0]})"), "edits[0].rotate.degrees"},
      {edit(R"(, "scale": -1)"), "edits[0].scale"},
      {edit(R"(, "scale": -1, "tint": [-1, -1, -1])"), "edits[0].tint: a factor is -1"},
      {edit(R"(, "scale": 100, "tint": [1, 1, 100])"), "edits[0].tint: a factor is 10000"},
      {R"({"edits": [{"name": "a", "direction": "eye", "select": "X@q X*E"}]})",
       R"(edits[0].select: column 1: there is no region 'q' (name it: "regions")"},
      {edit(R"(, "scale": 1e999)"), "number is too large"},
      {edit(R"(, "tint": [1, 1, 2000])"), "edits[0].tint"},
      {edit(R"(, "tint": [[1, 0, 0], [0, 1, 0], [0, 0, 1]])"), "edits[0].tint"},
      {R"({"regions": {"r": {"box": [1, 0, 0, 0, 1, 1]}}, "edits": []})", "regions.r.box"},
      {R"({"regions": {"r": {}}, "edits": []})", "regions.r"},
      {std::string(40, '[') + std::string(40, ']'), "nests"},
      {std::string(20000, ' '), "16384"},
      {"{\"\xff\": 1}", "UTF-8"}};
  for (const auto& [text, part] : faults)
    EXPECT_NE(error_of(text).find(part), std::string::npos) << text << "\n" << error_of(text);
  std::string many = R"({"edits": [)";
  for (int i = 0; i < 17; ++i)
    many += std::string(i > 0 ? "," : "") + R"({"name": "n)" + std::to_string(i) +
            R"(", "direction": "eye", "select": "XX*E", "scale": 0.5})";
  EXPECT_NE(error_of(many + "]}").find("edits[16]"), std::string::npos) << error_of(many + "]}");
}

// Claim: integrators that do not render edits refuse them, and so does a job whose light may grow without
// end.
TEST(EditText, IsRefusedByIntegrators) {
  const EditList list = *parse_edits(kWhole), bright = *parse_edits(edit(R"(, "scale": 2)")),
                 dim = *parse_edits(edit(R"(, "scale": 0.5)"));
  for (const char* able : {"path", "light", "bdpt", "ppm", "bpm", "vcm", "pssmlt", "mmlt"}) {
    EXPECT_TRUE(check_integrator(list, able, 5).ok()) << able;
    EXPECT_TRUE(check_integrator(dim, able, -1).ok()) << able;
    EXPECT_FALSE(check_integrator(list, able, -1).ok()) << able;
    EXPECT_FALSE(check_integrator(bright, able, -1).ok()) << able;
  }
  for (const char* other : {"upbp", "optimis", "appm", "cppm", "fppm", "vcmplus"}) {
    const auto refused = check_integrator(list, other, 5);
    ASSERT_FALSE(refused.ok()) << other;
    EXPECT_NE(refused.error().to_string().find(other), std::string::npos);
    EXPECT_TRUE(check_integrator(EditList{}, other, -1).ok());
  }
}

// Claim: text that is not an edit gives an error, whatever it is, and what is read is written and read again.
TEST(EditText, SurvivesRandomChanges) {
  rng::Stream stream(rng::key(7));
  int read = 0;
  for (int i = 0; i < 3000; ++i) {
    std::string text = kWhole;
    for (std::uint32_t changes = 1 + stream.next_u32() % 3; changes > 0; --changes) {
      const std::size_t at = stream.next_u32() % text.size();
      switch (stream.next_u32() % 4) {
        case 0:
          text[at] = static_cast<char>(stream.next_u32());
          break;
        case 1:
          text.erase(at, 1 + stream.next_u32() % 8);
          break;
        case 2:
          text.insert(at, text.substr(stream.next_u32() % text.size(), 12));
          break;
        default:
          text.insert(at, std::string(1, "0-9.eE\"{}[],:"[stream.next_u32() % 13]));
      }
      if (text.empty()) text = "{";
    }
    const auto list = parse_edits(text);
    if (!list.ok()) {
      EXPECT_FALSE(list.error().message.empty());
      continue;
    }
    ++read;
    const auto again = parse_edits(text_of(*list));
    ASSERT_TRUE(again.ok()) << text_of(*list);
    EXPECT_EQ(*again, *list);
  }
  EXPECT_GT(read, 30);
}

// ---- selections ----

using letters::Letter;
using letters::Side;

struct Objects {
  std::vector<letters::ObjectNames> names = {{"lamp"}, {"wall"}, {"mirror"}};
  std::vector<std::uint8_t> uses = {letters::kLampObject, letters::kSurfaceObject, letters::kSurfaceObject};
};

Result<Selection> select(const std::string& expression, bool of_light, const Objects& objects = {}) {
  EditList list;
  list.regions.push_back({"near", letters::Region::Kind::sphere, {0, 0, 0}, {}, 1});
  list.regions.push_back({"far", letters::Region::Kind::sphere, {9, 0, 0}, {}, 1});
  Edit one;
  one.name = "a";
  one.direction = of_light ? Edit::Direction::light : Edit::Direction::eye;
  one.select = expression;
  return Selection::compile(list, one, objects.names, objects.uses);
}

// Claim: an expression whose verdict is that of its vertex selects by letter, side, object and place.
TEST(EditSelection, IsThatOfTheVertex) {
  for (const bool of_light : {true, false}) {
    const auto on = [&](const std::string& token) {
      auto selection = select(of_light ? "LX*" + token : token + "X*E", of_light);
      EXPECT_TRUE(selection.ok()) << selection.error().to_string();
      return *std::move(selection);
    };
    const Selection mirror = on("SR{mirror}");
    EXPECT_TRUE(mirror.selects(Letter::specular, Side::reflected, 2, 0));
    EXPECT_FALSE(mirror.selects(Letter::specular, Side::transmitted, 2, 0));
    EXPECT_FALSE(mirror.selects(Letter::specular, Side::reflected, 1, 0));
    EXPECT_FALSE(mirror.selects(Letter::glossy, Side::reflected, 2, 0));
    const Selection far = on("[D@far G@far ]");
    EXPECT_TRUE(far.selects(Letter::diffuse, Side::reflected, 1, 2));
    EXPECT_TRUE(far.selects(Letter::glossy, Side::transmitted, 2, 3));
    EXPECT_FALSE(far.selects(Letter::diffuse, Side::reflected, 1, 1));
    EXPECT_FALSE(far.selects(Letter::specular, Side::reflected, 1, 2));
  }
  // Other ways to write the same.
  EXPECT_FALSE(select("L(D|G|S)*[SG]", true)->by_path());
  EXPECT_FALSE(select("LX*D|LX*G", true)->by_path());
}

// Claim: selections that depend on other vertices are told from those of the vertex alone; the wrong end is
// refused, and the error says how to write it.
TEST(EditSelection, RefusesTheWrongEnd) {
  const auto error = [](const std::string& expression, bool of_light, const Objects& objects = {}) {
    const auto selection = select(expression, of_light, objects);
    return selection.ok() ? std::string("none") : selection.error().to_string();
  };
  for (const char* expression : {"LDS", "LS", "LX", "LX*SX", "L{lamp}X*SD", "LX*D{wall}S"})
    EXPECT_TRUE(select(expression, true)->by_path()) << expression;
  for (const char* expression : {"SDE", "SE", "XSX*E"})
    EXPECT_TRUE(select(expression, false)->by_path()) << expression;
  for (const char* expression : {"SX*E", "LX*SE", "LX*E"})
    EXPECT_NE(error(expression, true).find("selects no vertex"), std::string::npos)
        << error(expression, true);
  EXPECT_NE(error("LX*S", false).find("ends with E"), std::string::npos) << error("LX*S", false);
  EXPECT_NE(error("LX*S{mirro}", true).find("edit 'a', column 4: no surface is called 'mirro'"),
            std::string::npos)
      << error("LX*S{mirro}", true);
  EXPECT_NE(error("S{mirro}X*E", false).find("edit 'a', column 1: no surface is called 'mirro'"),
            std::string::npos)
      << error("S{mirro}X*E", false);
  EXPECT_NE(error("E", false).find("selects no vertex"), std::string::npos) << error("E", false);
  Objects fog;
  fog.names.push_back({"fog"});
  fog.uses.push_back(letters::kMediumObject);
  EXPECT_TRUE(select("LX*S", true, fog)->by_path()) << "light that no medium scattered";
  EXPECT_FALSE(select("L[XV]*S", true, fog)->by_path());
}

// Claim: what a lamp emits is selected by an expression that may end with L, and scattering in a medium by
// one that may end, or for the eye begin, with V; each beside surfaces or without them.
TEST(EditSelection, HasLampsAndMedia) {
  Objects all;
  all.names.insert(all.names.end(), {{"sun"}, {"fog"}, {"smoke"}});
  all.uses.insert(all.uses.end(), {letters::kLampObject, letters::kMediumObject, letters::kMediumObject});
  const auto lamps = [&](const std::string& expression) {
    const auto selection = select(expression, true, all);
    EXPECT_TRUE(selection.ok()) << selection.error().to_string();
    return std::pair(selection->selects_lamp(0), selection->selects_lamp(3));
  };
  EXPECT_EQ(lamps("L"), std::pair(true, true));
  EXPECT_EQ(lamps("L{sun}"), std::pair(false, true));
  EXPECT_EQ(lamps("LX*"), std::pair(true, true));
  EXPECT_EQ(lamps("LX*S|L{lamp}"), std::pair(true, false));
  EXPECT_EQ(lamps("L[XV]*V"), std::pair(false, false));
  EXPECT_FALSE(select("L{lamp}", true, all)->by_path());
  EXPECT_FALSE(select("L{lamp}", true, all)->selects(Letter::diffuse, Side::reflected, 1, 0));
  EXPECT_FALSE(select("V{fog}[XV]*E", false, all)->selects_lamp(0));
  for (const bool of_light : {true, false}) {
    const auto fog = select(of_light ? "L[XV]*V{fog}" : "V{fog}[XV]*E", of_light, all);
    ASSERT_TRUE(fog.ok()) << fog.error().to_string();
    EXPECT_FALSE(fog->by_path());
    EXPECT_TRUE(fog->selects(Letter::volume, Side::none, 4, 0));
    EXPECT_FALSE(fog->selects(Letter::volume, Side::none, 5, 0));
    EXPECT_FALSE(fog->selects(Letter::diffuse, Side::reflected, 1, 0));
    const auto far = select(of_light ? "L[XV]*V@far " : "V@far [XV]*E", of_light, all);
    EXPECT_TRUE(far->selects(Letter::volume, Side::none, 5, 2));
    EXPECT_FALSE(far->selects(Letter::volume, Side::none, 5, 1));
    EXPECT_TRUE(select(of_light ? "LVV" : "VVE", of_light, all)->by_path());
  }
}

// ---- selections by the path ----

EditList list_of(const std::vector<std::pair<std::string, bool>>& expressions) {
  EditList list;
  for (const auto& [expression, of_light] : expressions) {
    Edit one;
    one.name = "a" + std::to_string(list.edits.size());
    one.direction = of_light ? Edit::Direction::light : Edit::Direction::eye;
    one.select = expression;
    list.edits.push_back(one);
  }
  return list;
}

struct Token {
  Letter letter;
  Side side;
  std::uint32_t object;
};

// Claim: the states of all edits of one direction give the verdict of each edit's expression on each vertex
// of random paths, as an automaton of that expression alone has it, and selections by the vertex have one
// state.
TEST(EditStates, GiveTheVerdictOfEachExpression) {
  Objects objects;
  objects.names.push_back({"sun"});
  objects.uses.push_back(letters::kLampObject);
  const EditList list = list_of({{"LX*S", true},
                                 {"LX*D{wall}X{mirror}", true},
                                 {"L{sun}X*ST", true},
                                 {"LXXX", true},
                                 {"DX*E", false},
                                 {"[SG]D?E", false},
                                 {"XXXE", false}});
  rng::Stream stream(rng::key(41));
  for (const bool of_light : {true, false}) {
    const auto states = PathStates::compile(list, of_light ? Edit::Direction::light : Edit::Direction::eye,
                                            objects.names, objects.uses);
    ASSERT_TRUE(states.ok()) << states.error().to_string();
    EXPECT_GT(states->size(), 3u);
    std::vector<letters::Automaton> alone;
    std::vector<std::size_t> number;
    for (std::size_t k = 0; k < list.edits.size(); ++k) {
      const Edit& edit = list.edits[k];
      if ((edit.direction == Edit::Direction::light) != of_light) continue;
      letters::LayerRequest request;
      request.layers = {{"x", of_light ? "(" + edit.select + ")E" : "L(" + edit.select + ")"}};
      alone.push_back(*letters::Automaton::compile(request, objects.names, objects.uses));
      number.push_back(k);
    }
    int selected = 0;
    for (int path = 0; path < 2000; ++path) {
      const std::uint32_t lamp = stream.next_u32() % 2 == 0 ? 0 : 3;
      std::vector<Token> tokens;  // from the edit's end on
      PathStates::State state = of_light ? states->at_lamp(lamp) : states->at_eye();
      for (std::uint32_t n = 1 + stream.next_u32() % 6; n > 0; --n) {
        const Token token{
            std::array{Letter::diffuse, Letter::glossy, Letter::specular}[stream.next_u32() % 3],
            stream.next_u32() % 2 == 0 ? Side::reflected : Side::transmitted, 1 + stream.next_u32() % 2};
        tokens.push_back(token);
        const auto c = states->class_of(token.letter, token.side, token.object, 0);
        const PathStates::Edits verdict = states->selected(state, c);
        state = states->next(state, c);
        for (std::size_t i = 0; i < alone.size(); ++i) {
          const letters::Automaton& a = alone[i];
          auto at = a.forward(a.forward_start(), a.class_of(Letter::lamp, Side::none, lamp, 0));
          const auto read = [&](const Token& t) {
            at = a.forward(at, a.class_of(t.letter, t.side, t.object, 0));
          };
          if (of_light)
            for (std::size_t j = 0; j < tokens.size(); ++j) read(tokens[j]);
          else
            for (std::size_t j = tokens.size(); j-- > 0;) read(tokens[j]);
          EXPECT_EQ((verdict >> number[i] & 1) != 0, a.label(at, a.reverse_start()) != 0)
              << list.edits[number[i]].select;
        }
        selected += verdict != 0;
      }
    }
    EXPECT_GT(selected, 500);
  }
  const auto by_vertex = PathStates::compile(list_of({{"LX*S", true}, {"LX*D{wall}", true}}),
                                             Edit::Direction::light, objects.names, objects.uses);
  EXPECT_EQ(by_vertex->size(), 1u);
  EXPECT_EQ(PathStates::compile(list, Edit::Direction::light, objects.names, objects.uses)->selected(0, 0),
            0);
}

// Claim: edits that tell too many paths apart are refused.
TEST(EditStates, AreAtMostSixteen) {
  const Objects objects;
  const auto checked = [&](const std::string& expression, bool of_light) {
    const EditList list = list_of({{expression, of_light}});
    const std::vector<Selection> selections = {
        *Selection::compile(list, list.edits[0], objects.names, objects.uses)};
    const auto result = check_by_path(list, selections, objects.names, objects.uses);
    return result.ok() ? std::string("none") : result.error().to_string();
  };
  EXPECT_EQ(checked("LDS", true), "none");
  EXPECT_EQ(checked("SDE", false), "none");
  EXPECT_EQ(checked("LX*S", true), "none");
  EXPECT_NE(checked("LX*DXXXXX", true).find("more than 16 kinds of paths"), std::string::npos);
}

}  // namespace
}  // namespace candela::edits
