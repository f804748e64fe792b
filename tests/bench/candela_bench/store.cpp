#include "tests/bench/candela_bench/store.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "common/base/files.h"
#include "common/base/version.h"

namespace candela::bench {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

constexpr std::uint64_t kRunLimitBytes = 1ULL << 28;
constexpr std::uint64_t kStateLimitBytes = 1ULL << 36;

// JSON has no NaN nor infinity: both are null.
Json number(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}
double number(const Json& json) {
  return json.is_null() ? std::numeric_limits<double>::quiet_NaN() : json.get<double>();
}

Json row_json(const RunSpec& run, const Row& row, const Reference* reference) {
  std::string settings;
  for (const auto& [key, value] : run.job.integrator_settings)
    settings += (settings.empty() ? "" : ";") + key + '=' + value;
  Json own_relmse_of_reference(nullptr);
  if (reference != nullptr && reference->own_error())
    own_relmse_of_reference = number(reference->own_error()->relmse);
  return {{"scene", run.scene},
          {"variant", run.variant},
          {"integrator", run.job.integrator},
          {"seed", run.job.seed},
          {"unit", row.unit},
          {"units", row.cost.units},
          {"cpu_seconds", row.cost.cpu_seconds},
          {"wall_seconds", row.cost.wall_seconds},
          {"relmse", number(row.figures.relmse)},
          {"relmse_trimmed", number(row.figures.relmse_trimmed)},
          {"relmse_fixed", number(row.figures.relmse_fixed)},
          {"rmse", number(row.figures.rmse)},
          {"smape", number(row.figures.smape)},
          {"flip", number(row.figures.flip)},
          {"own_relmse", number(row.own_relmse)},
          {"truth", row.truth},
          {"reference_factor", number(row.reference_factor)},
          {"least_factor", row.least_factor},
          {"reference_relmse", own_relmse_of_reference},
          {"eye_samples", row.cost.eye_samples},
          {"light_paths", row.cost.light_paths},
          {"rays", row.cost.rays},
          {"rejected", row.cost.rejected},
          {"deltas", row.cost.deltas},
          {"delta_bytes", row.cost.delta_bytes},
          {"peak_memory_bytes", row.cost.peak_memory_bytes},
          {"setup_seconds", row.cost.setup_seconds},
          {"threads", run.threads},
          {"width", run.job.width},
          {"height", run.job.height},
          {"settings", settings},
          {"scene_file", run.scene_file},
          {"scene_hash", run.scene_hash},
          {"reference", run.reference},
          {"reference_hash", run.reference_hash},
          {"run", run.id()},
          {"version", std::string(version())},
          {"build_id", std::string(build_id())},
          {"compiler", row.machine.compiler},
          {"cpu", row.machine.cpu},
          {"cores", row.machine.cores},
          {"memory_bytes", row.machine.memory_bytes},
          {"load_at_start", row.machine.load_at_start},
          {"started", row.machine.started},
          {"command", command_of(run, row.cost.units, row.flip, row.least_factor)}};
}

// The row that row_json() wrote, but for what the run says itself.
Row row_of(const Json& json) {
  Row row;
  Cost& cost = row.cost;
  json.at("unit").get_to(row.unit);
  json.at("units").get_to(cost.units);
  json.at("cpu_seconds").get_to(cost.cpu_seconds);
  json.at("wall_seconds").get_to(cost.wall_seconds);
  json.at("setup_seconds").get_to(cost.setup_seconds);
  json.at("eye_samples").get_to(cost.eye_samples);
  json.at("light_paths").get_to(cost.light_paths);
  json.at("rays").get_to(cost.rays);
  json.at("rejected").get_to(cost.rejected);
  json.at("deltas").get_to(cost.deltas);
  json.at("delta_bytes").get_to(cost.delta_bytes);
  json.at("peak_memory_bytes").get_to(cost.peak_memory_bytes);
  Figures& figures = row.figures;
  figures.relmse = number(json.at("relmse"));
  figures.relmse_trimmed = number(json.at("relmse_trimmed"));
  figures.relmse_fixed = number(json.at("relmse_fixed"));
  figures.rmse = number(json.at("rmse"));
  figures.smape = number(json.at("smape"));
  figures.flip = number(json.at("flip"));
  row.flip = !std::isnan(figures.flip);
  row.own_relmse = number(json.at("own_relmse"));
  json.at("truth").get_to(row.truth);
  json.at("least_factor").get_to(row.least_factor);
  row.reference_factor = number(json.at("reference_factor"));
  if (std::isnan(row.reference_factor) && row.truth != "unknown")  // of a reference without error
    row.reference_factor = std::numeric_limits<double>::infinity();
  json.at("cpu").get_to(row.machine.cpu);
  json.at("cores").get_to(row.machine.cores);
  json.at("memory_bytes").get_to(row.machine.memory_bytes);
  json.at("load_at_start").get_to(row.machine.load_at_start);
  json.at("started").get_to(row.machine.started);
  json.at("compiler").get_to(row.machine.compiler);
  return row;
}

std::string cell_of(const Json& value) {
  if (value.is_null()) return "";
  if (value.is_string()) return value.get<std::string>();
  return value.dump();
}

std::vector<std::string> cells_of(const Json& row) {
  std::vector<std::string> cells;
  for (const std::string& column : columns()) cells.push_back(cell_of(row.at(column)));
  return cells;
}

Error bad_run(const fs::path& file, std::string_view what) {
  return input_error(fmt::format("not the rows of a run: {}", what))
      .at(file.string(), 0)
      .with_mend("remove the file, and the same command makes its rows again");
}

Result<Json> read_run(const fs::path& file) {
  CANDELA_ASSIGN(const std::string text, read_file(file, kRunLimitBytes));
  try {
    Json json = Json::parse(text);
    for (const char* key : {"build_id", "state", "rows"})
      if (!json.contains(key)) return bad_run(file, fmt::format("'{}' is missing", key));
    return json;
  } catch (const Json::exception& error) {
    return bad_run(file, error.what());
  }
}

Result<std::vector<fs::path>> files_of(const fs::path& folder, std::string_view extension) {
  std::vector<fs::path> files;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error))
    if (entry.path().extension() == extension) files.push_back(entry.path());
  if (error) return resource_error(error.message()).at(folder.string(), 0);
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace

const std::vector<std::string>& columns() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    const Json any = row_json({}, {}, nullptr);
    for (auto cell = any.begin(); cell != any.end(); ++cell) all.push_back(cell.key());
    return all;
  }();
  return names;
}

std::string csv_line(const std::vector<std::string>& cells) {
  std::string line;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (i > 0) line += ',';
    if (cells[i].find_first_of(",\"\r\n") == std::string::npos) {
      line += cells[i];
      continue;
    }
    line += '"';
    for (const char c : cells[i]) line += c == '"' ? std::string("\"\"") : std::string(1, c);
    line += '"';
  }
  return line + '\n';
}

std::string csv_of(const RunSpec& run, const std::vector<Row>& rows, const Reference* reference,
                   bool header) {
  std::string text = header ? csv_line(columns()) : "";
  for (const Row& row : rows) text += csv_line(cells_of(row_json(run, row, reference)));
  return text;
}

Result<Store> Store::open(const fs::path& folder) {
  CANDELA_TRY(make_directories(folder / "runs"));
  CANDELA_ASSIGN(const auto files, files_of(folder / "runs", ".json"));
  for (const fs::path& file : files) {
    CANDELA_ASSIGN(const Json run, read_run(file));
    if (run.at("build_id") != std::string(build_id()))
      return refused_error(fmt::format("these rows were made by the build {}, this is {}",
                                       cell_of(run.at("build_id")), build_id()))
          .at(folder.string(), 0)
          .with_mend("give each build a folder of its own; a report takes several");
  }
  return Store(folder);
}

Result<void> Store::lock() const {
  const fs::path file = folder_ / "runs" / "lock";
  const int fd = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (fd < 0) return resource_error(std::strerror(errno)).at(file.string(), 0);
  if (::flock(fd, LOCK_EX | LOCK_NB) == 0) return {};  // stays open: it is the lock
  ::close(fd);
  return refused_error("another candela-bench works in this folder")
      .at(folder_.string(), 0)
      .with_mend("wait for it, or give --out another folder");
}

Result<void> Store::check_names(const std::vector<RunSpec>& runs) const {
  std::map<std::string, Json> scenes, variants;  // a row of each, without what is measured
  for (const RunSpec& run : runs) {
    const Json row = row_json(run, {}, nullptr);
    scenes.emplace(run.scene, row);
    variants.emplace(run.scene + '\n' + run.variant, row);
  }
  const auto differs = [](const std::map<std::string, Json>& known, const std::string& name, const Json& row,
                          std::initializer_list<const char*> columns) -> const char* {
    const auto found = known.find(name);
    if (found == known.end()) return nullptr;
    for (const char* column : columns)
      if (found->second.at(column) != row.at(column)) return column;
    return nullptr;
  };
  CANDELA_ASSIGN(const auto files, files_of(folder_ / "runs", ".json"));
  for (const fs::path& file : files) {
    CANDELA_ASSIGN(const Json run, read_run(file));
    try {
      if (run.at("rows").empty()) continue;
      const Json& row = run.at("rows").front();
      const auto scene = row.at("scene").get<std::string>(), variant = row.at("variant").get<std::string>();
      const char* other = differs(scenes, scene, row, {"scene_hash", "reference_hash", "width", "height"});
      if (other == nullptr)
        other = differs(variants, scene + '\n' + variant, row, {"integrator", "settings", "threads"});
      if (other != nullptr)
        return refused_error(
                   fmt::format("this folder has rows of {} with {} of another {}", scene, variant, other))
            .at(folder_.string(), 0)
            .with_mend("give --out another folder, or the scene or run of a list another name");
    } catch (const Json::exception& error) {
      return bad_run(file, error.what());
    }
  }
  return {};
}

std::string truth_of(double reference_factor, bool reference_error_known, double least) {
  if (!reference_error_known) return "unknown";
  return reference_factor >= least ? "good" : "noisy";
}

Result<Store::Kept> Store::read(const RunSpec& run) const {
  Kept kept;
  const fs::path file = folder_ / "runs" / (run.id() + ".json");
  if (!fs::exists(file)) return kept;
  CANDELA_ASSIGN(const Json json, read_run(file));
  try {
    for (const Json& row : json.at("rows")) kept.rows.push_back(row_of(row));
  } catch (const Json::exception& error) {
    return bad_run(file, error.what());
  }
  if (auto state = read_file(folder_ / "runs" / cell_of(json.at("state")), kStateLimitBytes); state.ok())
    kept.state = std::move(*state);
  return kept;
}

Result<void> Store::write(const RunSpec& run, const std::vector<Row>& rows, std::string_view state,
                          const Reference& reference) const {
  const fs::path runs = folder_ / "runs";
  const std::string id = run.id();
  const std::string state_name = fmt::format("{}-{}.state", id, rows.empty() ? 0 : rows.back().cost.units);
  if (!state.empty()) CANDELA_TRY(write_file_atomically(runs / state_name, state));
  Json json = {{"build_id", std::string(build_id())}, {"state", state_name}, {"rows", Json::array()}};
  for (const Row& row : rows) json["rows"].push_back(row_json(run, row, &reference));
  CANDELA_TRY(write_file_atomically(runs / (id + ".json"), json.dump(1) + '\n'));
  CANDELA_ASSIGN(const auto states, files_of(runs, ".state"));
  for (const fs::path& old : states)
    if (old.filename().string().starts_with(id + '-') && old.filename() != state_name) fs::remove(old);
  return {};
}

Result<void> Store::write_image(const std::string& name, std::uint32_t width, std::uint32_t height,
                                const std::vector<float>& rgb) const {
  CANDELA_TRY(make_directories(folder_ / "images"));
  return write_file_atomically(folder_ / "images" / (file_name_of(name) + ".npy"),
                               encode_npy(width, height, rgb));
}

Result<void> Store::collect() const {
  CANDELA_ASSIGN(const auto files, files_of(folder_ / "runs", ".json"));
  Json all = Json::array();
  std::string csv = csv_line(columns());
  for (const fs::path& file : files) {
    CANDELA_ASSIGN(const Json run, read_run(file));
    try {
      for (const Json& row : run.at("rows")) {
        csv += csv_line(cells_of(row));
        all.push_back(row);
      }
    } catch (const Json::exception& error) {
      return bad_run(file, error.what());
    }
  }
  CANDELA_TRY(write_file_atomically(folder_ / "rows.csv", csv));
  return write_file_atomically(folder_ / "rows.json", all.dump(1) + '\n');
}

std::string encode_npy(std::uint32_t width, std::uint32_t height, const std::vector<float>& rgb) {
  std::string header =
      fmt::format("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, {}, 3), }}", height, width);
  constexpr std::size_t kPrefix = 10, kAlign = 64;  // of the data's place in the file
  while ((kPrefix + header.size() + 1) % kAlign != 0) header += ' ';
  header += '\n';
  std::string bytes("\x93NUMPY\x01\x00", 8);
  bytes += static_cast<char>(header.size() & 0xff);
  bytes += static_cast<char>(header.size() >> 8);
  bytes += header;
  return bytes.append(reinterpret_cast<const char*>(rgb.data()), rgb.size() * sizeof(float));
}

}  // namespace candela::bench
