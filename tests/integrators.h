// The integrators as tests know them, one row each. A new integrator is a row here, and is then in the tests
// of exactness, of the farm, of stress and of golden films. unit_integrator compares the rows with the
// registry.
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace candela::test {

struct IntegratorRow {
  std::string name;
  bool chains = false;  // its units are bootstrap samples and segments of Markov chains
  bool merges = false;  // it merges photons: biased by a radius
  bool epochs = false;  // its radii are decided between epochs; `small` then has short ones
  // Iterations of a job on the farm that takes as long as one of path's with 1.
  double farm_share = 1;
  // Settings for which a few pixels are a small job.
  std::vector<std::pair<std::string, std::string>> small = {};
};

inline const std::vector<IntegratorRow>& integrators() {
  static const std::vector<std::pair<std::string, std::string>> few_chains = {
      {"chains", "8"}, {"bootstrap", "400"}, {"mutations", "1"}, {"direct_samples", "1"}};
  static const std::vector<IntegratorRow> rows = {
      {.name = "path"},
      {.name = "light", .farm_share = 0.2},
      {.name = "bdpt", .farm_share = 0.2},
      {.name = "ppm", .merges = true, .farm_share = 0.2},
      {.name = "bpm", .merges = true, .farm_share = 0.2},
      {.name = "vcm", .merges = true, .farm_share = 0.2},
      {.name = "optimis"},
      {.name = "pssmlt", .chains = true, .farm_share = 0.04, .small = few_chains},
      {.name = "mmlt", .chains = true, .farm_share = 0.04, .small = few_chains},
  };
  return rows;
}

inline const IntegratorRow& integrator_row(std::string_view name) {
  for (const IntegratorRow& row : integrators())
    if (row.name == name) return row;
  throw std::runtime_error("tests/integrators.h has no row '" + std::string(name) + "'");
}
inline bool has_chains(std::string_view name) {
  return integrator_row(name).chains;
}
inline bool merges(std::string_view name) {
  return integrator_row(name).merges;
}
inline bool has_epochs(std::string_view name) {
  return integrator_row(name).epochs;
}

// Names of the rows that fit.
template <class Predicate>
std::vector<std::string> integrators_where(const Predicate& fits) {
  std::vector<std::string> names;
  for (const IntegratorRow& row : integrators())
    if (fits(row)) names.push_back(row.name);
  return names;
}
inline std::vector<std::string> all_integrators() {
  return integrators_where([](const IntegratorRow&) { return true; });
}
inline std::vector<std::string> iteration_integrators() {
  return integrators_where([](const IntegratorRow& row) { return !row.chains; });
}
inline std::vector<std::string> chain_integrators() {
  return integrators_where([](const IntegratorRow& row) { return row.chains; });
}
inline std::vector<std::string> merging_integrators() {
  return integrators_where([](const IntegratorRow& row) { return row.merges; });
}

}  // namespace candela::test
