// candela objects: the names of a scene that light path expressions know.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <ostream>

#include "client/commands/commands.h"
#include "client/context.h"
#include "client/json.h"
#include "client/values.h"
#include "common/description/object_list.h"

namespace candela::client {
namespace {

struct ObjectsOptions {
  SceneOptions scene;
  bool json = false;
};

std::string kinds_text(const description::NamedObjects& row) {
  std::vector<std::string> parts;
  for (const auto& [kind, count] : row.kinds)
    parts.push_back(count == 1 ? printable(kind) : fmt::format("{} {}", count, printable(kind)));
  return join(parts, ", ");
}

std::string bounds_text(const description::NamedObjects& row) {
  if (!row.bounds) return "-";
  const auto& [low, high] = *row.bounds;
  const auto point = [](const description::Vec3& p) {
    return fmt::format("{:.4g},{:.4g},{:.4g}", p[0], p[1], p[2]);
  };
  return low == high ? point(low) : fmt::format("{} to {}", point(low), point(high));
}

void print(std::ostream& out, std::string_view title, const std::vector<description::NamedObjects>& rows) {
  if (rows.empty()) return;
  constexpr std::size_t widest = 40;
  std::size_t width = title.size();
  for (const auto& row : rows) width = std::max(width, std::min(printable(row.name).size(), widest));
  out << fmt::format("{:<{}} {:>7}  {:<24} {}\n", title, width, "COUNT", "KIND", "BOUNDS");
  for (const auto& row : rows)
    out << fmt::format("{:<{}} {:>7}  {:<24} {}\n", row.name.empty() ? "(no name)" : printable(row.name),
                       width, row.count(), kinds_text(row), bounds_text(row));
}

Result<int> run_objects(Context& context, const ObjectsOptions& options) {
  CANDELA_ASSIGN(const auto parameters, parse_assignments(options.scene.defines, "-D"));
  CANDELA_ASSIGN(const std::uint64_t memory, scene_memory_bytes(options.scene));
  CANDELA_ASSIGN(const bundle::GatheredScene gathered,
                 bundle::gather(options.scene.scene, parameters, options.scene.reading(), memory));
  const description::ObjectList list = description::list_objects(*gathered.description.scene);
  if (options.json) {
    context.out << objects_json(list) << '\n';
    return 0;
  }
  print(context.out, "SURFACE", list.surfaces);
  print(context.out, "LAMP", list.lamps);
  print(context.out, "MEDIUM", list.media);
  return 0;
}

}  // namespace

void add_objects(CLI::App& app, Context& context) {
  auto options = std::make_shared<ObjectsOptions>();
  CLI::App* sub =
      app.add_subcommand("objects",
                         "List the names of surfaces, lamps and media for light path expressions (--layer), "
                         "with numbers of shapes, and bounds if the scene file has them");
  SceneOptions& scene = options->scene;
  add_scene_file(*sub, scene);
  add_text(*sub, "--integrator", scene.integrator,
           "Integrator to use instead of the scene's, with the scene's values of common parameters", "NAME");
  add_lenient(*sub, scene);
  add_scene_memory(*sub, scene);
  sub->add_flag("--json", options->json, "Print JSON");
  set_command(*sub, context, run_objects, options);
}

}  // namespace candela::client
