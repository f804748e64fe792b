// The integrators as tests know them, one row each. A new integrator is a row here, and is then in the tests
// of exactness, of the farm, of stress, of pictures and of golden films. The fields of the short form say
// which expensive tests continuous integration runs for it; the long form (CANDELA_LONG=1) runs all.
// unit_integrator compares the rows with the registry.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace candela::test {

// On which scenes of transport/ the short form compares an integrator's picture with others: on all, on
// three, on none; or no form does, because tests of its own do.
enum class Pictures { everywhere, some, nightly, own_tests };

struct IntegratorRow {
  std::string name;
  bool chains = false;  // its units are bootstrap samples and segments of Markov chains
  bool merges = false;  // it merges photons: biased by a radius
  bool epochs = false;  // radii or steps are decided between epochs; `small` then has short ones
  // Iterations of a job on the farm that takes as long as one of path's with 1.
  double farm_share = 1;
  // It renders media of all kinds, and takes edits; without them it is in no test that has some among others.
  bool everything = true;
  // Settings for which a few pixels are a small job.
  std::vector<std::pair<std::string, std::string>> small = {};
  // The integrator whose scenes and radii are its own too; empty: none other.
  std::string like = {};

  // The short form.
  Pictures pictures = Pictures::nightly;
  // Stands on a farm for the integrators with units of its kind: a farm knows iterations, epochs and chains,
  // and that a film depends on nothing else is ExactnessOf's for each integrator.
  bool stands_for_kind = false;
  std::vector<std::string> unit_times = {};  // seconds of the units of which a farm makes the picture
  // Number of deaths of a job's master, 20: its workers die, sleep and leave too. 0: all of that is left to
  // the long form.
  int deaths = 0;
  // Iterations of a job of the soak, some seconds of work; 0: the soak, long or short, does without it.
  std::uint64_t soak_iterations = 0;

  const std::string& family() const { return like.empty() ? name : like; }
};

inline const std::vector<IntegratorRow>& integrators() {
  static const std::vector<std::pair<std::string, std::string>> few_chains = {
      {"chains", "8"}, {"bootstrap", "400"}, {"mutations", "1"}, {"direct_samples", "1"}};
  // Some pixels reject their radius within a few iterations.
  static const std::vector<std::pair<std::string, std::string>> early_f_tests = {
      {"epoch_min", "2"}, {"radius", "0.05"}, {"alpha_f", "0.3"}};
  static const std::vector<IntegratorRow> rows = {
      {.name = "path",
       .pictures = Pictures::everywhere,
       .stands_for_kind = true,
       .unit_times = {"0.01", "5"},
       .deaths = 20,
       .soak_iterations = 2500},
      {.name = "light", .farm_share = 0.2, .pictures = Pictures::everywhere},
      {.name = "bdpt", .farm_share = 0.2, .pictures = Pictures::everywhere},
      {.name = "ppm", .merges = true, .farm_share = 0.2, .pictures = Pictures::everywhere},
      {.name = "bpm", .merges = true, .farm_share = 0.2, .pictures = Pictures::everywhere},
      {.name = "vcm",
       .merges = true,
       .farm_share = 0.2,
       .pictures = Pictures::everywhere,
       .soak_iterations = 400},
      {.name = "upbp", .merges = true, .farm_share = 0.1, .like = "vcm", .pictures = Pictures::own_tests},
      {.name = "optimis", .like = "path", .pictures = Pictures::own_tests, .soak_iterations = 1000},
      {.name = "fppm",
       .merges = true,
       .epochs = true,
       .farm_share = 0.2,
       .small = early_f_tests,
       .like = "ppm",
       .pictures = Pictures::own_tests,
       .soak_iterations = 250},
      {.name = "cppm",
       .merges = true,
       .epochs = true,
       .farm_share = 0.2,
       .small = {{"epoch_min", "2"}, {"radius", "0.05"}, {"alpha_chi", "0.3"}},
       .like = "ppm",
       .pictures = Pictures::own_tests},
      {.name = "appm",
       .merges = true,
       .epochs = true,
       .farm_share = 0.2,
       .small = {{"epoch_min", "2"}, {"radius", "0.05"}},
       .like = "ppm",
       .pictures = Pictures::own_tests},
      {.name = "vcmplus",
       .merges = true,
       .epochs = true,
       .farm_share = 0.2,
       .small = early_f_tests,
       .like = "vcm",
       .pictures = Pictures::own_tests,
       .stands_for_kind = true,
       .unit_times = {"0.01"},
       .deaths = 5,
       .soak_iterations = 250},
      // Chains run even where they do not pay.
      {.name = "mcppm",
       .merges = true,
       .epochs = true,
       .farm_share = 0.1,
       .small = {{"epoch_min", "2"}, {"plan", "full"}},
       .like = "ppm",
       .pictures = Pictures::some},
      {.name = "pssmlt",
       .chains = true,
       .farm_share = 0.02,
       .small = few_chains,
       .stands_for_kind = true,
       .unit_times = {"0.01"},
       .deaths = 20,
       .soak_iterations = 30},
      {.name = "mmlt", .chains = true, .farm_share = 0.04, .small = few_chains},
      {.name = "mlt", .chains = true, .farm_share = 0.04, .everything = false, .small = few_chains},
      {.name = "erpt",
       .farm_share = 0.04,
       .everything = false,
       .small = {{"bootstrap", "400"}},
       .like = "bdpt",
       .pictures = Pictures::own_tests},
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
// One for each kind of unit.
inline std::vector<std::string> kinds_of_units() {
  return integrators_where([](const IntegratorRow& row) { return row.stands_for_kind; });
}
inline std::vector<std::string> all_integrators() {
  return integrators_where([](const IntegratorRow&) { return true; });
}
inline std::vector<std::string> iteration_integrators() {
  return integrators_where([](const IntegratorRow& row) { return !row.chains; });
}
inline std::vector<std::string> iteration_integrators_in_media() {
  return integrators_where([](const IntegratorRow& row) { return !row.chains && row.everything; });
}
inline std::vector<std::string> chain_integrators() {
  return integrators_where([](const IntegratorRow& row) { return row.chains; });
}
inline std::vector<std::string> merging_integrators() {
  return integrators_where([](const IntegratorRow& row) { return row.merges; });
}

}  // namespace candela::test
