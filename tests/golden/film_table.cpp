#include "tests/golden/film_table.h"

#include <algorithm>
#include <charconv>
#include <set>
#include <sstream>

#include "common/base/hash.h"

namespace candela::golden {
namespace {

constexpr const char* kTableName = "films.txt";

std::vector<std::string> words_of(const std::string& line) {
  std::istringstream stream(line);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

// 0 if the text is not a whole number.
std::uint64_t number_of(std::string_view text) {
  std::uint64_t value = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  return code == std::errc() && end == text.data() + text.size() ? value : 0;
}

template <class Visit>
Result<void> each_line(std::string_view text, const Visit& visit) {
  std::istringstream stream{std::string(text)};
  int number = 0;
  for (std::string line; std::getline(stream, line);) {
    CANDELA_TRY(visit(++number, line));
  }
  return {};
}

Result<GoldenFilm> parse_film(const std::vector<std::string>& words, int line) {
  if (words.size() < 3)
    return input_error("a film's line is HASH SCENE INTEGRATOR [NAME=VALUE ...]").at(kTableName, line);
  GoldenFilm film{line, words[0], words[1], words[2], {}};
  if (film.hash != "-" && !is_sha256_hex(film.hash))
    return input_error("'" + film.hash + "' is not a SHA-256 in lower-case hex").at(kTableName, line);
  for (std::size_t i = 3; i < words.size(); ++i) {
    const std::size_t equals = words[i].find('=');
    if (equals == 0 || equals == std::string::npos || equals + 1 == words[i].size())
      return input_error("'" + words[i] + "' is not NAME=VALUE").at(kTableName, line);
    film.settings.emplace_back(words[i].substr(0, equals), words[i].substr(equals + 1));
  }
  return film;
}

}  // namespace

std::string GoldenFilm::name() const {
  std::string text = scene + " " + integrator;
  for (const auto& [key, value] : settings) text.append(" ").append(key).append("=").append(value);
  return text;
}

std::vector<std::string> FilmTable::scenes() const {
  std::vector<std::string> names;
  for (const GoldenFilm& film : films)
    if (std::find(names.begin(), names.end(), film.scene) == names.end()) names.push_back(film.scene);
  return names;
}

Result<FilmTable> parse_table(std::string_view text) {
  FilmTable table;
  std::set<std::string> known;
  CANDELA_TRY(each_line(text, [&](int number, const std::string& line) -> Result<void> {
    const std::vector<std::string> words = words_of(line);
    if (words.empty() || words[0][0] == '#') return {};
    if (words[0] == "version") {
      table.version = words.size() == 2 ? number_of(words[1]) : 0;
      if (table.version == 0) return input_error("not 'version N', N above 0").at(kTableName, number);
      return {};
    }
    CANDELA_ASSIGN(GoldenFilm film, parse_film(words, number));
    if (!known.insert(film.name()).second)
      return input_error("the film '" + film.name() + "' is listed twice").at(kTableName, number);
    table.films.push_back(std::move(film));
    return {};
  }));
  if (table.version == 0) return input_error("the line 'version N' is missing").at(kTableName, 0);
  return table;
}

std::string with_hashes(std::string_view text, const std::map<int, std::string>& hashes,
                        std::uint64_t version) {
  std::string written;
  const auto done = each_line(text, [&](int number, const std::string& line) -> Result<void> {
    if (const auto found = hashes.find(number); found != hashes.end()) {
      const std::size_t end = line.find(' ');
      written += found->second + line.substr(std::min(end, line.size()));
    } else if (version != 0 && line.starts_with("version ")) {
      written += "version " + std::to_string(version);
    } else {
      written += line;
    }
    written += '\n';
    return {};
  });
  static_cast<void>(done);  // the visitor above has no error
  return written;
}

std::uint64_t last_logged_version(std::string_view log) {
  std::uint64_t last = 0;
  const auto done = each_line(log, [&](int, const std::string& line) -> Result<void> {
    const std::size_t colon = line.find(": ");
    if (colon == std::string::npos || colon + 2 == line.size()) return {};
    if (const std::uint64_t version = number_of(line.substr(0, colon)); version != 0) last = version;
    return {};
  });
  static_cast<void>(done);  // the visitor above has no error
  return last;
}

}  // namespace candela::golden
