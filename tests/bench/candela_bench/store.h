// Rows, and the folder they are kept in: for each run its rows (runs/ID.json) and the state from which it
// goes on (runs/ID-UNITS.state); for all rows.csv and rows.json. Every file is whole or absent, and a run's
// file refers only to a state that was written before, so that a run goes on from its last point after any
// kill.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "tests/bench/candela_bench/estimator.h"
#include "tests/bench/candela_bench/figures.h"
#include "tests/bench/candela_bench/machine.h"
#include "tests/bench/candela_bench/spec.h"

namespace candela::bench {

// One point of one run.
struct Row {
  Cost cost;
  std::string unit;
  Figures figures;
  double own_relmse = 0;
  double reference_factor = 0;  // NaN: the reference's own error is not known
  std::string truth;            // "good", "noisy": factor too small, "unknown"
  Machine machine;
  bool flip = true;
  double least_factor = kReferenceFactor;  // by which `truth` was judged
};

// A row's `truth` by its factor; `unknown` where the reference's own error is.
std::string truth_of(double reference_factor, bool reference_error_known, double least);

// Names of all columns, in the order of rows.csv.
const std::vector<std::string>& columns();
std::string csv_line(const std::vector<std::string>& cells);  // RFC 4180, with "\n"
// Rows of a run, with or without the header.
std::string csv_of(const RunSpec& run, const std::vector<Row>& rows, const Reference* reference, bool header);

class Store {
 public:
  // Creates the folder. Refused where it holds runs of another build.
  static Result<Store> open(const std::filesystem::path& folder);
  // Until this process ends nobody else gets it. Refused where another process has it.
  Result<void> lock() const;
  // Refused where the folder has rows of one of these scenes with another file, reference or size, or of one
  // of these scenes and variants with other settings or another number of threads: they would look like one.
  Result<void> check_names(const std::vector<RunSpec>& runs) const;

  struct Kept {
    std::vector<Row> rows;
    std::string state;  // as of the last row; empty: none, or not readable
  };
  // The rows of the run; nothing if there is none.
  Result<Kept> read(const RunSpec& run) const;
  // The rows of the run so far and, if not empty, the state that belongs to the last.
  Result<void> write(const RunSpec& run, const std::vector<Row>& rows, std::string_view state,
                     const Reference& reference) const;
  // The image of a run, or the reference of a scene, as a NumPy array: images/NAME.npy.
  Result<void> write_image(const std::string& name, std::uint32_t width, std::uint32_t height,
                           const std::vector<float>& rgb) const;
  // rows.csv and rows.json from all runs there are.
  Result<void> collect() const;

  const std::filesystem::path& folder() const { return folder_; }

 private:
  explicit Store(std::filesystem::path folder) : folder_(std::move(folder)) {}
  std::filesystem::path folder_;
};

// A float array of shape (height, width, 3) in NumPy's format, version 1.0.
std::string encode_npy(std::uint32_t width, std::uint32_t height, const std::vector<float>& rgb);

}  // namespace candela::bench
