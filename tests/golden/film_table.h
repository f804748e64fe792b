// The table of golden films, films.txt. Lines are empty, begin with '#', or are one of
//
//   version N
//   HASH SCENE INTEGRATOR [NAME=VALUE ...]
//
// HASH is a SHA-256 in hex (film_hash.h), or "-" for a film that has not been rendered yet. A setting is one
// of the integrator, or one of filter, sampler, seed, isa, iterations, rounds, threads.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"

namespace candela::golden {

struct GoldenFilm {
  int line = 0;  // in the table, 1-based
  std::string hash;
  std::string scene, integrator;
  std::vector<std::pair<std::string, std::string>> settings;  // in the order of the line

  // Scene, integrator and settings as the table writes them.
  std::string name() const;
};

struct FilmTable {
  std::uint64_t version = 0;
  std::vector<GoldenFilm> films;
  std::vector<std::string> scenes() const;  // in order, without duplicates
};

// An error names the table's line.
Result<FilmTable> parse_table(std::string_view text);

// The table with other hashes, by line. All other text stays; so does the version, unless `version` is not 0.
std::string with_hashes(std::string_view text, const std::map<int, std::string>& hashes,
                        std::uint64_t version);

// The version that the last line "N: reason" of log.md is about; 0 if there is none.
std::uint64_t last_logged_version(std::string_view log);

}  // namespace candela::golden
