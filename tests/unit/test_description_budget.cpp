// Small scene files that ask for much memory, and lists that only a quadratic reader takes long for.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "common/base/memory_limit.h"
#include "common/base/thread_cpu.h"
#include "common/description/reading.h"
#include "common/description/reading_budget.h"
#include "tests/unit/description_pbrt_reading.h"
#include "tests/unit/gzip.h"
#include "tests/unit/live_bytes.h"

namespace candela::description {
namespace {

using test::gzip;

constexpr std::uint64_t mebibyte = std::uint64_t{1} << 20;

std::string repeated(const std::string& text, std::size_t count) {
  std::string result;
  result.reserve(text.size() * count);
  for (std::size_t i = 0; i < count; ++i) result += text;
  return result;
}

// Text `count` times, each with its number in the place of every '#'.
std::string numbered(const std::string& text, std::size_t count) {
  std::string result;
  for (std::size_t i = 0; i < count; ++i)
    for (const char c : text) {
      if (c == '#')
        result += std::to_string(i);
      else
        result += c;
    }
  return result;
}

// A world of `part` a million times, by files that include files.
Files million(const std::string& before, const std::string& part) {
  return {{"scene.pbrt", "WorldBegin\n" + before + "\n" + repeated("Include \"a.pbrt\"\n", 1000)},
          {"a.pbrt", repeated(part + "\n", 1000)}};
}

std::uint64_t size_of(const Files& files) {
  std::uint64_t bytes = 0;
  for (const auto& [key, text] : files) bytes += text.size();
  return bytes;
}

struct Kind {
  std::string name;
  Files files;
  std::string place;  // of the error
};

std::vector<Kind> kinds() {
  const std::string object = "ObjectBegin \"o\" Shape \"sphere\" ObjectEnd";
  return {
      {"instances", million(object, "ObjectInstance \"o\""), "a.pbrt:"},
      {"spheres", million("", "Shape \"sphere\" \"float radius\" 1"), "a.pbrt:"},
      {"materials", million("", "Material \"diffuse\""), "a.pbrt:"},
      {"lights", million("", "LightSource \"point\""), "a.pbrt:"},
      {"lamps", million("", "AreaLightSource \"diffuse\" Shape \"sphere\""), "a.pbrt:"},
      {"scopes",
       {{"scene.pbrt", "WorldBegin\n" + repeated("Include \"a.pbrt\"\n", 90)},
        {"a.pbrt", repeated("AttributeBegin\n", 1000)}},
       "a.pbrt:"},
      {"lists of numbers",
       {{"scene.pbrt", "WorldBegin Include \"a.pbrt.gz\""},
        {"a.pbrt.gz", gzip("Shape \"sphere\" \"float many\" [" + repeated(" 1", 2'500'000) + "]")}},
       "a.pbrt.gz:1"},
      {"strings",
       {{"scene.pbrt", "WorldBegin Include \"a.pbrt.gz\""},
        {"a.pbrt.gz", gzip("Shape \"sphere\" \"string many\" [" + repeated(" \"\"", 600'000) + "]")}},
       "a.pbrt.gz:1"},
      {"strings with escapes",
       {{"scene.pbrt", "WorldBegin Include \"a.pbrt.gz\""},
        {"a.pbrt.gz", gzip("Shape \"sphere\" \"string many\" [" + repeated(" \"\\t\"", 600'000) + "]")}},
       "a.pbrt.gz:1"},
      {"flags and names",
       {{"scene.pbrt", "WorldBegin Include \"a.pbrt.gz\""},
        {"a.pbrt.gz", gzip("Shape \"sphere\"" + numbered("\"bool f#\" true ", 150'000))}},
       "a.pbrt.gz:1"},
      {"blanks",
       {{"scene.pbrt", "Include \"a.pbrt.gz\""}, {"a.pbrt.gz", gzip(std::string(40 << 20, ' '))}},
       "a.pbrt.gz:"},
      {"shapes by include of XML",
       {{"scene.xml",
         "<scene version='3.0.0'>" + repeated("<include filename='a.xml'/>\n", 1000) + "</scene>"},
        {"a.xml", "<scene version='3.0.0'>" + repeated("<shape type='sphere'/>\n", 1000) + "</scene>"}},
       "a.xml:"},
      {"elements of XML",
       {{"scene.xml", "<scene version='3.0.0'><include filename='a.xml.gz'/></scene>"},
        {"a.xml.gz", gzip("<scene version='3.0.0'>" + repeated("<a/>", 500'000) + "</scene>")}},
       "a.xml.gz"},
      {"attributes of XML",
       {{"scene.xml", "<scene version='3.0.0'><include filename='a.xml.gz'/></scene>"},
        {"a.xml.gz", gzip("<scene version='3.0.0'><a " + repeated("b='' ", 500'000) + "/></scene>")}},
       "a.xml.gz"},
      {"references",
       {{"scene.xml", "<scene version='3.0.0'><bsdf type='diffuse' id='a'/>" +
                          repeated("<include filename='a.xml'/>\n", 1000) + "</scene>"},
        {"a.xml", "<scene version='3.0.0'>" + repeated("<ref id='a'/>\n", 1000) + "</scene>"}},
       "a.xml:"},
      {"long values",
       {{"scene.xml", "<scene version='3.0.0'><default name='a' value='" + std::string(1 << 20, 'x') + "'/>" +
                          numbered("<default name='b#' value='$a'/>\n", 200) + "</scene>"}},
       "scene.xml:"},
  };
}

// Claim: a small scene that asks for much memory is refused with the place, the limit and the option that
// raises it; memory grows no further than the budget, and the count of it is right within a factor of two.
TEST(ReadingBudget, SmallFilesThatAskForMuchAreRefused) {
  constexpr std::uint64_t limit = 16 * mebibyte;
  for (const Kind& kind : kinds()) {
    SCOPED_TRACE(kind.name);
    ASSERT_LT(size_of(kind.files), 3 * mebibyte);
    const std::string main = kind.files.contains("scene.pbrt") ? "scene.pbrt" : "scene.xml";
    const MemorySource files(kind.files);
    ReadingBudget budget(limit);
    const BudgetedFiles counted(files, budget);
    test::reset_peak_live_bytes();
    const std::uint64_t before = test::live_bytes();
    double seconds = 0;
    const auto read = with_cpu_time(seconds, [&] { return read_scene(counted, main, {}, {}); });
    const std::uint64_t grown = test::peak_live_bytes() - before;
    const std::string told = outcome_of(read);
    EXPECT_TRUE(told.starts_with(kind.place)) << told;
    EXPECT_NE(told.find("more memory than the 16 MiB that reading it may take"), std::string::npos) << told;
    EXPECT_NE(told.find("--scene-memory"), std::string::npos) << told;
    EXPECT_LT(grown, 2 * limit) << told;
    EXPECT_LT(seconds, 5) << told;
    RecordProperty(kind.name, std::to_string(grown / mebibyte) + " MiB, " + std::to_string(seconds) + " s");
    std::printf("%-28s %5.0f MiB %6.2f s  %s\n", kind.name.c_str(),
                static_cast<double>(grown) / static_cast<double>(mebibyte), seconds, told.c_str());
  }
}

// Claim: what reading counts at the end is what the description has in memory, within a factor of two.
TEST(ReadingBudget, TheCountIsTheMemory) {
  const std::string object = "ObjectBegin \"o\" Shape \"sphere\" ObjectEnd\n";
  const std::string element = "<shape type='sphere'><float name='radius' value='2'/><ref id='a'/></shape>\n";
  const std::string file = std::string(4'000, 'x') + ".pgm";
  const std::string picture =
      "<texture type='bitmap' id='#'><string name='filename' value='" + file + "'/></texture>\n";
  const std::vector<std::pair<std::string, Files>> scenes = {
      {"scene.pbrt", {{"scene.pbrt", "WorldBegin\n" + object + repeated("ObjectInstance \"o\"\n", 20'000)}}},
      {"scene.pbrt",
       {{"scene.pbrt", "WorldBegin\n" + repeated("Material \"diffuse\" Shape \"sphere\"\n", 20'000)}}},
      {"scene.pbrt", {{"scene.pbrt", "WorldBegin\n" + repeated("LightSource \"point\"\n", 20'000)}}},
      {"scene.xml",
       {{"scene.xml",
         "<scene version='3.0.0'><bsdf type='diffuse' id='a'/>" + repeated(element, 20'000) + "</scene>"}}},
      {"scene.xml",
       {{"scene.xml", "<scene version='3.0.0'>" + numbered(picture, 2'000) + "</scene>"},
        {file, "P5 1 1 255 x"}}},
  };
  for (const auto& [main, files] : scenes) {
    const MemorySource source(files);
    ReadingBudget budget(1024 * mebibyte);
    const BudgetedFiles counted(source, budget);
    const std::uint64_t before = test::live_bytes();
    const auto read = read_scene(counted, main, {}, {});
    ASSERT_TRUE(read.ok()) << outcome_of(read);
    const std::uint64_t grown = test::live_bytes() - before;
    EXPECT_GT(budget.used(), grown / 2) << files.at(main).substr(0, 200);
    EXPECT_LT(budget.used(), 3 * grown) << files.at(main).substr(0, 200);
    std::printf("counted %.1f MiB, alive %.1f MiB\n", static_cast<double>(budget.used()) / mebibyte,
                static_cast<double>(grown) / mebibyte);
  }
}

double seconds_of(const Files& files, const Reading& reading) {
  const MemorySource source(files);
  double least = 1e9;
  for (int i = 0; i < 2; ++i) {
    double seconds = 0;
    const std::string main = files.contains("scene.pbrt") ? "scene.pbrt" : "scene.xml";
    const auto read = with_cpu_time(seconds, [&] { return read_scene(source, main, {}, reading); });
    EXPECT_TRUE(read.ok()) << outcome_of(read);
    least = std::min(least, seconds);
  }
  return least;
}

// Claim: four times as long lists take no more than nine times as long to read; a quadratic reader takes
// sixteen.
TEST(ReadingBudget, ReadingIsLinear) {
  const auto pbrt = [](const std::string& world) { return Files{{"scene.pbrt", "WorldBegin\n" + world}}; };
  const auto xml = [](const std::string& body) {
    return Files{{"scene.xml", "<scene version='3.0.0'>" + body + "</scene>"}};
  };
  struct Case {
    std::string name;
    std::size_t count;
    std::function<Files(std::size_t)> files;
    Reading reading = {};
  };
  const Reading lenient{.integrator = "path", .lenient = true};
  const std::vector<Case> cases = {
      {"parameters of a directive", 6000,
       [&](std::size_t n) { return pbrt("Shape \"sphere\" " + numbered("\"float a#\" 1 ", n)); }, lenient},
      {"repeated Attribute", 6000,
       [&](std::size_t n) { return pbrt(numbered("Attribute \"shape\" \"float a#\" 1\n", n)); }},
      {"scopes with values", 3000,
       [&](std::size_t n) {
         return pbrt(numbered("Attribute \"shape\" \"float a#\" 1\n", n) +
                     repeated("AttributeBegin Shape \"sphere\" AttributeEnd\n", n));
       }},
      {"scopes that add a value", 3000,
       [&](std::size_t n) {
         return pbrt(
             numbered("Attribute \"shape\" \"float a#\" 1\n", n) +
             repeated("AttributeBegin Attribute \"shape\" \"float b\" 1 Shape \"sphere\" AttributeEnd\n", n));
       }},
      {"nested scopes", 3000,
       [&](std::size_t n) {
         return pbrt(numbered("AttributeBegin Attribute \"shape\" \"float a#\" 1\n", n) +
                     repeated("AttributeEnd\n", n));
       }},
      {"integrators that are passed over", 6000,
       [&](std::size_t n) {
         return xml(repeated("<shape type='sphere'/>", n) + repeated("<integrator type='path'/>", n));
       },
       lenient},
  };
  for (const Case& one : cases) {
    SCOPED_TRACE(one.name);
    const double few = seconds_of(one.files(one.count), one.reading);
    const double many = seconds_of(one.files(4 * one.count), one.reading);
    EXPECT_LT(many, 9 * few);
    std::printf("%-34s %.3f s, four times as many %.3f s\n", one.name.c_str(), few, many);
  }
}

// Claim: the parameter that is given last counts, in long lists and in short ones.
TEST(ReadingBudget, TheLastValueCountsInLongLists) {
  const std::string long_list = numbered("\"float a#\" 1 ", 40);
  for (const std::string& before : {std::string(), long_list}) {
    const auto read = read_pbrt("WorldBegin Shape \"sphere\" " + before +
                                    "\"float radius\" 1 \"float radius\" 2 " + before + "\"float radius\" 3",
                                {}, {.integrator = "path", .lenient = true});
    ASSERT_TRUE(read.ok()) << outcome_of(read);
    EXPECT_EQ(read->description.scene->children_of("shape").at(0)->get_number("radius", 0), 3);
  }
}

// Claim: values of Attribute count where the directive has none of the name, in the scope and within; the
// last one counts, and the scope's end brings back those before it.
TEST(ReadingBudget, SharedValuesFollowScopes) {
  const std::string many = numbered("Attribute \"shape\" \"float a#\" 1\n", 50);
  const auto read =
      read_pbrt("WorldBegin Attribute \"shape\" \"float radius\" 2\n" + many +
                "AttributeBegin Attribute \"shape\" \"float radius\" 3 Shape \"sphere\" AttributeEnd\n"
                "Shape \"sphere\" Shape \"sphere\" \"float radius\" 5\n");
  ASSERT_TRUE(read.ok()) << outcome_of(read);
  std::vector<double> radii;
  for (const ObjectPtr& shape : read->description.scene->children_of("shape"))
    radii.push_back(shape->get_number("radius", 0));
  EXPECT_EQ(radii, (std::vector<double>{3, 2, 5}));
}

// Claim: 100,001 instances of a group of 200 spheres, 20 million unfolded, are read within 256 MiB.
TEST(ReadingBudget, ManyInstancesOfALargeGroupAreRead) {
  std::string scene = "<scene version='3.0.0'><shape type='shapegroup' id='g'>";
  scene += numbered("<shape type='sphere'><point name='center' x='#' y='0' z='0'/></shape>\n", 200);
  scene += "</shape>\n" + numbered(
                              "<shape type='instance'><ref id='g'/><transform name='to_world'>"
                              "<translate y='#'/></transform></shape>\n",
                              100'001);
  scene += "</scene>";
  const MemorySource files({{"scene.xml", scene}});
  ReadingBudget budget(256 * mebibyte);
  const BudgetedFiles counted(files, budget);
  const auto read = read_scene(counted, "scene.xml", {}, {});
  ASSERT_TRUE(read.ok()) << outcome_of(read);
  EXPECT_EQ(read->description.scene->children_of("shape").size(), 100'002U);
}

// Claim: bytes that are given back can be taken again, and bytes that do not fit are not counted.
TEST(ReadingBudget, BytesAreGivenBack) {
  ReadingBudget budget(100);
  {
    Charge charge(budget);
    EXPECT_TRUE(charge.take(60));
    EXPECT_FALSE(charge.take(60));
    EXPECT_EQ(budget.used(), 60U);
    Charge moved = std::move(charge);
    EXPECT_FALSE(budget.take(UINT64_MAX));
    moved.give_back(20);
    EXPECT_TRUE(moved.take(60));
    EXPECT_EQ(budget.left(), 0U);
  }
  EXPECT_EQ(budget.used(), 0U);
  EXPECT_TRUE(ReadingBudget::unlimited().take(UINT64_MAX));
  EXPECT_TRUE(ReadingBudget::unlimited().take(UINT64_MAX));
}

// Claim: the default is half of what the process may have: of the machine's memory at most.
TEST(ReadingBudget, TheDefaultIsHalfOfTheMemory) {
  EXPECT_EQ(ReadingBudget(0).limit(), memory_limit_bytes() / 2);
  EXPECT_GT(memory_limit_bytes(), 16 * mebibyte);
}

}  // namespace
}  // namespace candela::description
