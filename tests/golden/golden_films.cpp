// Every integrator on every scene of films.txt renders the committed film, to the last bit. A refactoring
// must leave the table as it is; a change that is meant to change pictures rewrites the table by
//
//   build/bin/golden_films --write
//
// and says why in log.md. film_hash.h says what a hash is made of.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/files.h"
#include "tests/golden/film_hash.h"
#include "tests/golden/film_table.h"
#include "tests/integrators.h"
#include "tests/paths.h"
#include "worker/render/renderer.h"

namespace candela::golden {
namespace {

const std::string kTablePath = test::source_path("tests/golden/films.txt");
const std::string kLogPath = test::source_path("tests/golden/log.md");

template <class T>
T value_of(Result<T> result) {
  if (!result.ok()) throw std::runtime_error(result.error().to_string());
  return std::move(result).value();
}

std::string read_text(const std::string& path) {
  return value_of(read_file(path, 1 << 24));
}

FilmTable read_table() {
  return value_of(parse_table(read_text(kTablePath)));
}

class GoldenFilms : public testing::TestWithParam<std::string> {};

// Claim: each film of the scene is the committed one, to the last bit.
TEST_P(GoldenFilms, AreUnchanged) {
  for (const GoldenFilm& film : read_table().films) {
    if (film.scene != GetParam()) continue;
    const std::string hash = film_hash(film);
    if (hash == film.hash) continue;
    std::string settings;
    for (const auto& [name, value] : film.settings) settings += fmt::format(" {}={}", name, value);
    ADD_FAILURE() << fmt::format(
        "tests/golden/films.txt:{}: the film of scene {}, integrator {}, settings{} has changed\n"
        "  expected {}\n  got      {}\n"
        "If the change is meant: build/bin/golden_films --write rewrites the table; say why in "
        "tests/golden/log.md",
        film.line, film.scene, film.integrator, settings.empty() ? " (defaults)" : settings, film.hash, hash);
  }
}

std::vector<std::string> scene_names() try {
  return read_table().scenes();
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return {};  // GoldenTable.IsReadable fails
}

std::string test_name(const testing::TestParamInfo<std::string>& info) {
  std::string name = info.param;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}

INSTANTIATE_TEST_SUITE_P(Scenes, GoldenFilms, testing::ValuesIn(scene_names()), test_name);
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(GoldenFilms);

// Claim: the committed table can be read, lists films, and each has a hash.
TEST(GoldenTable, IsReadable) {
  const FilmTable table = read_table();
  EXPECT_FALSE(table.films.empty());
  for (const GoldenFilm& film : table.films) EXPECT_NE(film.hash, "-") << film.name();
}

// Claim: every integrator renders every scene with its defaults; one that does not render all scenes has
// some.
TEST(GoldenTable, HasEveryIntegratorOnEveryScene) {
  const FilmTable table = read_table();
  std::set<std::string> names;
  for (const GoldenFilm& film : table.films) names.insert(film.name());
  std::map<std::string, int> some;
  for (const std::string& scene : table.scenes())
    for (const std::string& integrator : render::integrator_names())
      if (!test::integrator_row(integrator).everything)
        some[integrator] += static_cast<int>(names.count(scene + " " + integrator));
      else
        EXPECT_TRUE(names.count(scene + " " + integrator) == 1) << scene + " " + integrator + " is missing";
  for (const auto& [integrator, count] : some) EXPECT_GT(count, 3) << integrator;
}

// Claim: of every setting of every integrator, the table has a value other than the default; of a setting
// that is one of several names, all of them.
TEST(GoldenTable, ChangesEverySettingOfEveryIntegrator) {
  std::set<std::string> changed;  // "integrator name=value", and "integrator name"
  for (const GoldenFilm& film : read_table().films)
    for (const auto& [name, value] : film.settings) {
      changed.insert(fmt::format("{} {}={}", film.integrator, name, value));
      changed.insert(fmt::format("{} {}", film.integrator, name));
    }
  for (const std::string& integrator : render::integrator_names())
    for (const render::SettingDoc& setting : value_of(render::integrator_settings(integrator))) {
      const std::string name = fmt::format("{} {}", integrator, setting.name);
      EXPECT_EQ(changed.count(name), 1U) << "no film of " << name;
      if (setting.type.find(" | ") == std::string::npos) continue;
      for (std::size_t begin = 0; begin < setting.type.size();) {
        const std::size_t end = std::min(setting.type.find(" | ", begin), setting.type.size());
        const std::string value = setting.type.substr(begin, end - begin);
        if (value != setting.default_value) {
          EXPECT_EQ(changed.count(name + "=" + value), 1U) << "no film of " << name << "=" << value;
        }
        begin = end + 3;
      }
    }
}

// Claim: whoever changed the table has said why.
TEST(GoldenTable, HasItsVersionInTheLog) {
  EXPECT_EQ(last_logged_version(read_text(kLogPath)), read_table().version)
      << "tests/golden/log.md ends with a line 'N: reason', N being the version in films.txt";
}

// Claim: a hash tells films apart that differ in one sample's random numbers, and is the same twice and with
// two threads.
TEST(FilmHash, IsOfTheFilm) {
  GoldenFilm film{0, "-", "box-diffuse", "path", {{"iterations", "2"}}};
  const std::string hash = film_hash(film);
  EXPECT_EQ(film_hash(film), hash);
  film.settings.emplace_back("threads", "2");
  EXPECT_EQ(film_hash(film), hash);
  film.settings.emplace_back("seed", "2");
  EXPECT_NE(film_hash(film), hash);
}

// Claim: bad lines are refused with their number, and rewriting changes hashes and nothing else.
TEST(FilmTable, IsReadAndRewritten) {
  const std::string a(64, 'a'), b(64, 'b');
  const std::string text = "# films\nversion 3\n\n- box path\n" + a + " box vcm max_depth=2 filter=tent\n";
  const FilmTable table = value_of(parse_table(text));
  EXPECT_EQ(table.version, 3U);
  ASSERT_EQ(table.films.size(), 2U);
  EXPECT_EQ(table.films[0].hash, "-");
  EXPECT_EQ(table.films[1].line, 5);
  EXPECT_EQ(table.films[1].name(), "box vcm max_depth=2 filter=tent");
  EXPECT_EQ(with_hashes(text, {{4, b}}, 0),
            "# films\nversion 3\n\n" + b + " box path\n" + a + " box vcm max_depth=2 filter=tent\n");
  EXPECT_EQ(with_hashes(text, {}, 4).substr(0, 18), "# films\nversion 4\n");
  for (const char* line : {"- box", "abc box path", "- box path max_depth", "- box path =2", "version 0"}) {
    const auto parsed = parse_table("version 1\n" + std::string(line) + "\n");
    ASSERT_FALSE(parsed.ok()) << line;
    EXPECT_EQ(parsed.error().line, 2) << line;
  }
  EXPECT_FALSE(parse_table("- box path\n").ok());
  EXPECT_FALSE(parse_table("version 1\n- box path\n- box path\n").ok());
  EXPECT_EQ(last_logged_version("# Log\n1: first\n2: second\nnot: a version\n3:\n"), 2U);
}

// Renders all films and writes the table. If a film changed, the version becomes one that the log does not
// have yet.
int write_table() {
  const std::string text = read_text(kTablePath);
  const FilmTable table = value_of(parse_table(text));
  std::map<int, std::string> hashes;
  std::size_t changed = 0, added = 0;
  for (const GoldenFilm& film : table.films) {
    const std::string hash = film_hash(film);
    if (hash == film.hash) continue;
    ++(film.hash == "-" ? added : changed);
    std::printf("%s: %s\n", film.hash == "-" ? "new" : "changed", film.name().c_str());
    std::fflush(stdout);
    hashes[film.line] = hash;
  }
  const bool explained = last_logged_version(read_text(kLogPath)) == table.version;
  const std::uint64_t version = changed > 0 && explained ? table.version + 1 : table.version;
  if (!hashes.empty())
    if (const auto done = write_file_atomically(kTablePath, with_hashes(text, hashes, version)); !done.ok())
      throw std::runtime_error(done.error().to_string());
  std::printf("%zu films: %zu changed, %zu new; version %llu\n", table.films.size(), changed, added,
              static_cast<unsigned long long>(version));
  if (changed > 0)
    std::printf("Say why in tests/golden/log.md: a last line '%llu: reason'\n",
                static_cast<unsigned long long>(version));
  return 0;
}

}  // namespace
}  // namespace candela::golden

int main(int argc, char** argv) try {
  testing::InitGoogleTest(&argc, argv);
  if (argc == 1) return RUN_ALL_TESTS();
  if (argc == 2 && std::string_view(argv[1]) == "--write") return candela::golden::write_table();
  std::fprintf(stderr, "usage: golden_films [--write] [--gtest_...]\n");
  return 2;
} catch (const std::exception& error) {
  std::fprintf(stderr, "golden_films: error: %s\n", error.what());
  return 1;
}
