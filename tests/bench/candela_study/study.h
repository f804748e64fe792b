// candela-study: experiments that remake figures and tables of papers. Pages about them: docs/studies.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace candela::study {

inline constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

// One number of a study. A field that does not apply is empty or NaN.
struct Row {
  std::string part;      // of the study
  std::string problem;   // scene, field or integrand
  std::string method;    // integrator or heuristic
  double alpha = kNone;  // by which the radius shrinks
  double n = kNone;      // iterations or samples
  std::string quantity;
  double value = kNone;
  double standard_error = kNone;  // 0: exact
};

// A picture of one value a pixel, row by row.
struct Map {
  std::string name;
  std::uint32_t width = 0, height = 0;
  std::vector<float> values;
};

struct Results {
  std::vector<Row> rows;
  std::vector<Map> maps;
};

struct Request {
  bool short_form = false;  // seconds
  std::uint64_t seeds = 1;  // independent runs, with the seeds 1, 2, ...
  unsigned threads = 1;
  // Names of scenes or pieces that are run, in studies that have them (see Study); empty: all.
  std::vector<std::string> scenes;
  // Options of studies in pieces:
  std::uint32_t side = 0;        // of pictures, in pixels; 0: the study's own
  std::filesystem::path folder;  // where pieces are kept; empty: nowhere
  bool wants(const std::string& scene) const {
    return scenes.empty() || std::find(scenes.begin(), scenes.end(), scene) != scenes.end();
  }
  std::function<void(const std::string& line)> say = [](const std::string&) {};
};

struct Study {
  std::string_view name;
  std::string_view summary;
  std::string_view source;  // in the words of docs/references.bib, and the figure or equation
  std::uint64_t seeds;      // default; 0: it renders nothing, and its random numbers are its own
  std::uint64_t short_seeds;
  Result<Results> (*run)(const Request& request);
  // Takes the side and names of scenes, keeps the results of each scene, and goes on with what is left.
  bool in_pieces = false;
  bool by_scene = false;  // takes names of scenes alone
};

// All studies, by name.
std::span<const Study> studies();
// An error if `request` asks for a scene that is none of these.
Result<void> check_scenes(const Request& request, const std::vector<std::string>& known);
// Null if there is no study of that name.
const Study* find_study(std::string_view name);

Result<Results> run_ups_alpha(const Request& request);
Result<Results> run_bias_aware(const Request& request);
Result<Results> run_fppm_comparison(const Request& request);
Result<Results> run_mis_1d(const Request& request);
Result<Results> run_mis_scenes(const Request& request);
Result<Results> run_fppm_scenes(const Request& request);
Result<Results> run_lag(const Request& request);
Result<Results> run_metropolis_photons(const Request& request);
Result<Results> run_regularisation(const Request& request);
Result<Results> run_upbp_nsd(const Request& request);
Result<Results> run_upbp_scenes(const Request& request);
Result<Results> run_vcmplus_table(const Request& request);

}  // namespace candela::study
