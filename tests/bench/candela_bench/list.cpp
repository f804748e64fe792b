// From a list and options to the runs: `prepare`.
#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <set>
#include <sstream>

#include "common/base/files.h"
#include "common/description/text.h"
#include "tests/bench/candela_bench/figures.h"
#include "tests/bench/candela_bench/spec.h"
#include "worker/render/renderer.h"

namespace candela::bench {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kListLimitBytes = 1 << 20;

struct SceneEntry {
  std::string file, name, reference;
};
struct VariantEntry {
  std::string integrator, name;
  SettingsMap settings;
  std::vector<std::string> scenes;  // empty: all
};
struct List {
  std::vector<SceneEntry> scenes;
  std::vector<VariantEntry> variants;
  std::vector<std::uint64_t> seeds;
};

int line_of(const toml::node& node) {
  return static_cast<int>(node.source().begin.line);
}

// Reads keys of a table and complains of those nobody asked for.
class Table {
 public:
  Table(const toml::table& table, std::string file) : table_(table), file_(std::move(file)) {}

  template <class T>
  Result<void> take(const std::string& key, T& value, bool required = false) {
    known_.insert(key);
    const toml::node* const node = table_.get(key);
    if (node == nullptr)
      return required
                 ? Result<void>(input_error(fmt::format("'{}' is missing", key)).at(file_, line_of(table_)))
                 : Result<void>();
    const auto found = node->value<T>();
    if (!found) return wrong(*node, key);
    value = *found;
    return {};
  }
  template <class T>
  Result<void> take(const std::string& key, std::optional<T>& value) {
    T read{};
    CANDELA_TRY(take(key, read));
    if (table_.get(key) != nullptr && !value) value = read;  // an option comes first
    return {};
  }
  Result<void> take(const std::string& key, std::vector<std::string>& values) {
    known_.insert(key);
    const toml::node* const node = table_.get(key);
    if (node == nullptr) return {};
    if (node->as_array() == nullptr) return wrong(*node, key);
    for (const toml::node& element : *node->as_array()) {
      const auto text = element.value<std::string>();
      if (!text) return wrong(element, key);
      values.push_back(*text);
    }
    return {};
  }
  Result<void> take(const std::string& key, SettingsMap& values) {
    known_.insert(key);
    const toml::node* const node = table_.get(key);
    if (node == nullptr) return {};
    if (node->as_table() == nullptr) return wrong(*node, key);
    for (const auto& [name, element] : *node->as_table()) {
      const std::string setting(name.str());
      if (const auto* text = element.as_string())
        values[setting] = text->get();
      else if (const auto* integer = element.as_integer())
        values[setting] = fmt::format("{}", integer->get());
      else if (const auto* number = element.as_floating_point())
        values[setting] = fmt::format("{}", number->get());
      else if (const auto* flag = element.as_boolean())
        values[setting] = flag->get() ? "true" : "false";
      else
        return wrong(element, setting);
    }
    return {};
  }
  // Seeds: a number of them, from 1 on, or the seeds themselves.
  Result<void> take_seeds(const std::string& key, std::vector<std::uint64_t>& seeds) {
    known_.insert(key);
    const toml::node* const node = table_.get(key);
    if (node == nullptr) return {};
    if (const auto count = node->value<std::int64_t>(); count && *count > 0 && *count <= 10000) {
      for (std::int64_t seed = 1; seed <= *count; ++seed) seeds.push_back(static_cast<std::uint64_t>(seed));
      return {};
    }
    if (node->as_array() == nullptr) return wrong(*node, key);
    for (const toml::node& element : *node->as_array()) {
      const auto seed = element.value<std::int64_t>();
      if (!seed || *seed < 0) return wrong(element, key);
      seeds.push_back(static_cast<std::uint64_t>(*seed));
    }
    return seeds.empty() ? wrong(*node, key) : Result<void>();
  }
  Result<std::vector<const toml::table*>> tables(const std::string& key) {
    known_.insert(key);
    std::vector<const toml::table*> found;
    const toml::node* const node = table_.get(key);
    if (node == nullptr) return found;
    if (node->as_array() == nullptr) return wrong(*node, key).error();
    for (const toml::node& element : *node->as_array()) {
      if (element.as_table() == nullptr) return wrong(element, key).error();
      found.push_back(element.as_table());
    }
    return found;
  }
  Result<void> done() const {
    for (const auto& [key, node] : table_)
      if (!known_.contains(std::string(key.str()))) {
        std::string names;
        for (const std::string& name : known_) names += (names.empty() ? "" : ", ") + name;
        return input_error(fmt::format("unknown key '{}'", std::string(key.str())))
            .at(file_, line_of(node))
            .with_mend("there is " + names);
      }
    return {};
  }

 private:
  Result<void> wrong(const toml::node& node, const std::string& key) const {
    return input_error(fmt::format("'{}' cannot be this", key))
        .at(file_, line_of(node))
        .with_mend("docs/bench.md shows a list");
  }
  const toml::table& table_;
  std::string file_;
  std::set<std::string> known_;
};

Result<void> check_name(const std::string& name, const std::string& file, int line) {
  if (!name.empty()) return {};
  return input_error("a name is empty").at(file, line);
}

Result<List> read_list(const std::string& file, RunOptions& options) {
  CANDELA_ASSIGN(const std::string text, read_file(file, kListLimitBytes));
  toml::table parsed;
  try {
    parsed = toml::table(toml::parse(text, file));
  } catch (const toml::parse_error& error) {
    return input_error(std::string(error.description()))
        .at(file, static_cast<int>(error.source().begin.line));
  }
  const fs::path folder = fs::absolute(file).parent_path();
  const auto beside = [&](const std::string& path) {
    return (folder / path).lexically_normal().string();  // an absolute path stays what it is
  };
  List list;
  Table top(parsed, file);
  std::optional<std::string> out;
  CANDELA_TRY(top.take("out", out));
  if (out && !options.out) options.out = beside(*out);
  const bool limited = options.iterations.has_value() || options.seconds.has_value();
  std::optional<std::uint64_t> iterations;
  std::optional<double> seconds;
  CANDELA_TRY(top.take("iterations", iterations));
  CANDELA_TRY(top.take("time", seconds));
  if (!limited) {
    options.iterations = iterations;
    options.seconds = seconds;
  }
  CANDELA_TRY(top.take("clock", options.clock));
  CANDELA_TRY(top.take("threads", options.threads));
  CANDELA_TRY(top.take("beside", options.beside));
  CANDELA_TRY(top.take("slice", options.slice_seconds));
  CANDELA_TRY(top.take("points_per_doubling", options.points_per_doubling));
  CANDELA_TRY(top.take("reference_factor", options.reference_factor));
  std::optional<bool> flip;
  CANDELA_TRY(top.take("flip", flip));
  if (flip && !*flip) options.no_flip = true;
  CANDELA_TRY(top.take_seeds("seeds", list.seeds));
  CANDELA_ASSIGN(const auto scenes, top.tables("scene"));
  for (const toml::table* entry : scenes) {
    Table table(*entry, file);
    SceneEntry scene;
    CANDELA_TRY(table.take("file", scene.file, true));
    CANDELA_TRY(table.take("reference", scene.reference, true));
    scene.file = beside(scene.file);
    scene.reference = beside(scene.reference);
    scene.name = scene_name_of(scene.file);
    CANDELA_TRY(table.take("name", scene.name));
    CANDELA_TRY(table.done());
    CANDELA_TRY(check_name(scene.name, file, line_of(*entry)));
    for (const SceneEntry& other : list.scenes)
      if (file_name_of(other.name) == file_name_of(scene.name))
        return input_error(
                   fmt::format("'{}' and '{}' would be one in names of files", other.name, scene.name))
            .at(file, line_of(*entry))
            .with_mend("give one of the scenes another `name`");
    list.scenes.push_back(std::move(scene));
  }
  CANDELA_ASSIGN(const auto variants, top.tables("run"));
  for (const toml::table* entry : variants) {
    Table table(*entry, file);
    VariantEntry variant;
    CANDELA_TRY(table.take("integrator", variant.integrator, true));
    variant.name = variant.integrator;
    CANDELA_TRY(table.take("name", variant.name));
    CANDELA_TRY(table.take("set", variant.settings));
    CANDELA_TRY(table.take("scenes", variant.scenes));
    CANDELA_TRY(table.done());
    CANDELA_TRY(check_name(variant.name, file, line_of(*entry)));
    for (const std::string& name : variant.scenes)
      if (std::none_of(list.scenes.begin(), list.scenes.end(),
                       [&](const SceneEntry& scene) { return scene.name == name; }))
        return input_error(fmt::format("no scene of this list is called '{}'", name))
            .at(file, line_of(*entry));
    list.variants.push_back(std::move(variant));
  }
  CANDELA_TRY(top.done());
  if (list.scenes.empty()) return input_error("the list has no [[scene]]").at(file, 1);
  if (list.variants.empty()) return input_error("the list has no [[run]]").at(file, 1);
  return list;
}

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> parts;
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, ',');) parts.push_back(part);
  if (parts.empty()) parts.emplace_back();  // which is nobody's name
  return parts;
}

// Keeps what has one of these names; each name must be one, or several with commas between.
template <class Entry, class NameOf>
Result<void> filter(std::vector<Entry>& entries, const std::vector<std::string>& wanted,
                    std::string_view option, const NameOf& name_of) {
  if (wanted.empty()) return {};
  std::vector<std::string> names;
  for (const std::string& name : wanted) {
    const bool whole =
        std::any_of(entries.begin(), entries.end(), [&](const Entry& e) { return name_of(e, name); });
    for (const std::string& part : whole ? std::vector<std::string>{name} : split(name))
      names.push_back(part);
  }
  for (const std::string& name : names)
    if (std::none_of(entries.begin(), entries.end(), [&](const Entry& e) { return name_of(e, name); }))
      return usage_error(fmt::format("'{}' is not in the list", name)).with_field(std::string(option));
  std::erase_if(entries, [&](const Entry& entry) {
    return std::none_of(names.begin(), names.end(), [&](const auto& name) { return name_of(entry, name); });
  });
  return {};
}

Result<List> list_of_options(const RunOptions& options) {
  List list;
  if (options.scenes.size() != 1)
    return usage_error("without a list there is one scene").with_field("--scene");
  if (options.reference.empty())
    return usage_error("an error is measured against a reference")
        .with_field("--reference")
        .with_mend("candela-bench reference makes one");
  SceneEntry scene{options.scenes[0], options.name, options.reference};
  if (scene.name.empty()) scene.name = scene_name_of(scene.file);
  list.scenes.push_back(std::move(scene));
  std::vector<std::string> integrators;
  for (const std::string& names : options.integrators)
    for (const std::string& name : split(names)) integrators.push_back(name);
  if (integrators.empty()) integrators = render::integrator_names();
  for (const std::string& integrator : integrators) {
    CANDELA_ASSIGN(SettingsMap settings, settings_for(integrator, integrators, options.sets));
    list.variants.push_back({integrator, integrator, std::move(settings), {}});
  }
  return list;
}

template <class T>
Result<void> within(std::string_view option, T value, T least, T most) {
  if (value >= least && value <= most) return {};
  return usage_error(fmt::format("must be between {} and {}", least, most)).with_field(std::string(option));
}

}  // namespace

Result<Work> prepare(const RunOptions& given) {
  RunOptions options = given;
  List list;
  if (options.list.empty()) {
    CANDELA_ASSIGN(list, list_of_options(options));
  } else {
    if (!options.reference.empty() || !options.name.empty() || !options.sets.empty())
      return usage_error("--reference, --name and --set are the list's business")
          .with_mend("write them into the list");
    CANDELA_ASSIGN(list, read_list(options.list, options));
    CANDELA_TRY(filter(list.scenes, options.scenes, "--scene",
                       [](const SceneEntry& e, const std::string& name) { return e.name == name; }));
    CANDELA_TRY(filter(list.variants, options.integrators, "--integrator",
                       [](const VariantEntry& e, const std::string& name) {
                         return e.name == name || e.integrator == name;
                       }));
  }
  if (!options.seeds.empty()) list.seeds = options.seeds;
  if (list.seeds.empty()) list.seeds = {1};

  Work work;
  if (options.iterations.has_value() == options.seconds.has_value())
    return usage_error("give either --iterations or --time").with_field("--iterations");
  if (options.iterations) {
    CANDELA_TRY(within<std::uint64_t>("--iterations", *options.iterations, 1, Limits::max_iterations));
    work.budget.iterations = *options.iterations;
  } else {
    CANDELA_TRY(within("--time", *options.seconds, 1e-3, 1e8));
    work.budget.seconds = *options.seconds;
  }
  const std::string clock = options.clock.value_or("cpu");
  if (clock != "cpu" && clock != "wall")
    return usage_error(fmt::format("'{}' is neither cpu nor wall", clock)).with_field("--clock");
  work.budget.wall_clock = clock == "wall";
  work.budget.slice_seconds = options.slice_seconds.value_or(work.budget.slice_seconds);
  CANDELA_TRY(within("--slice", work.budget.slice_seconds, 1e-3, 3600.0));
  work.budget.points_per_doubling = options.points_per_doubling.value_or(1);
  CANDELA_TRY(within("--points-per-doubling", work.budget.points_per_doubling, 1, 16));
  work.reference_factor = options.reference_factor.value_or(work.reference_factor);
  CANDELA_TRY(within("--reference-factor", work.reference_factor, 1.0, 1e6));
  const unsigned threads = options.threads.value_or(1);
  CANDELA_TRY(within("--threads", threads, 1U, 1024U));
  work.beside = options.beside.value_or(0);
  work.out = options.out.value_or("");
  work.flip = !options.no_flip;

  for (const SceneEntry& scene : list.scenes) {
    // Read whole: what is wrong with it is said before anything is rendered.
    CANDELA_ASSIGN(const auto reference, Reference::read(scene.reference, false));
    for (const VariantEntry& variant : list.variants) {
      if (!variant.scenes.empty() &&
          std::find(variant.scenes.begin(), variant.scenes.end(), scene.name) == variant.scenes.end())
        continue;
      CANDELA_ASSIGN(RunSpec run, make_run(scene.file, scene.name, variant.integrator, variant.settings,
                                           reference->width(), reference->height()));
      run.variant = variant.name;
      run.threads = threads;
      run.reference = fs::absolute(scene.reference).lexically_normal().string();
      run.reference_hash = reference->hash();
      for (const std::string& text : {run.variant, run.reference})
        if (!description::text::is_utf8(text))
          return usage_error(fmt::format("{} is not UTF-8", description::text::quote(text)))
              .with_mend("rows are CSV and JSON, which are: rename it");
      for (const std::uint64_t seed : list.seeds) {
        run.job.seed = seed;
        work.runs.push_back(run);
      }
    }
  }
  if (work.runs.empty())
    return usage_error("there is nothing to run: no run of the list is for these scenes")
        .with_field("--scene");
  // If only some are in memory at a time: all variants of a scene and seed beside each other.
  std::stable_sort(work.runs.begin(), work.runs.end(), [](const RunSpec& a, const RunSpec& b) {
    return a.scene == b.scene && a.job.seed < b.job.seed;
  });
  std::set<std::string> ids;
  for (const RunSpec& run : work.runs)
    if (!ids.insert(run.id()).second)
      return input_error(
                 fmt::format("{} with {} and seed {} is listed twice", run.scene, run.variant, run.job.seed))
          .at(options.list, 0)
          .with_mend("give runs of other settings another name");
  return work;
}

}  // namespace candela::bench
