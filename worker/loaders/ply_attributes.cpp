// Finds the numbers of a PLY file's rows that are attributes of vertices and of faces.
#include <fmt/format.h>

#include <optional>

#include "worker/loaders/ply_header.h"

namespace candela::loaders::ply {
namespace {

// Numbers that belong together.
struct Group {
  std::string name, other_name;  // without vertex_ or face_
  std::vector<std::size_t> properties;
};

std::optional<std::size_t> number_named(const Element& element, std::string_view name) {
  for (std::size_t i = 0; i < element.properties.size(); ++i)
    if (!element.properties[i].list && element.properties[i].name == name) return i;
  return std::nullopt;
}

// kEndings[k] has the endings of component k in four naming schemes; a scheme is a column.
constexpr std::array<std::string_view, 3> kEndings = {"xr01", "yg12", "zb23"};

std::vector<Group> groups_of(const Element& element) {
  std::vector<Group> groups;
  for (const auto& names : {std::array<std::string_view, 3>{"r", "g", "b"},
                            std::array<std::string_view, 3>{"red", "green", "blue"}}) {
    const auto r = number_named(element, names[0]), g = number_named(element, names[1]),
               b = number_named(element, names[2]);
    if (!r || !g || !b) continue;
    groups.push_back({"color", "color", {*r, *g, *b}});
    break;
  }
  std::string open;          // the prefix of the current group
  std::size_t counting = 0;  // its naming scheme
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    const Property& p = element.properties[i];
    const auto bar = p.name.size() < 3 ? p.name.npos : p.name.size() - 2;
    if (p.list || p.role != Role::none || bar == p.name.npos || p.name[bar] != '_') {
      open.clear();
      continue;
    }
    const std::string prefix = p.name.substr(0, bar);
    const char ending = p.name.back();
    if (!open.empty() && prefix == open) {
      Group& group = groups.back();
      const std::size_t next = group.properties.size();
      if (next < kEndings.size() && kEndings[next][counting] == ending) {
        group.properties.push_back(i);
        continue;
      }
      open.clear();
      continue;
    }
    const auto way = kEndings[0].find(ending);
    open.clear();
    if (way == std::string_view::npos) continue;
    open = prefix;
    counting = way;
    groups.push_back({prefix, way == 1 ? prefix + "_color" : prefix, {i}});
  }
  std::erase_if(groups, [](const Group& g) { return g.properties.size() != 1 && g.properties.size() != 3; });
  return groups;
}

}  // namespace

Result<void> find_attributes(Header& header, const std::vector<std::string>& wanted,
                             const std::string& name) {
  if (wanted.size() > kMaxAttributes)
    return input_error(fmt::format("more than {} attributes of a mesh are asked for", kMaxAttributes))
        .at(name, 0);
  for (const std::string& full : wanted) {
    const bool of_faces = full.starts_with("face_");
    Element& element = header.elements[of_faces ? header.faces : header.vertices];
    const std::string_view prefix = of_faces ? "face_" : "vertex_";
    auto& found = of_faces ? header.face_attributes : header.vertex_attributes;
    bool known = false;
    std::string others;
    for (const Group& group : groups_of(element)) {
      others += fmt::format("{}'{}{}'", others.empty() ? "" : ", ", prefix, shown(group.other_name));
      if (known || (full != fmt::format("{}{}", prefix, group.name) &&
                    full != fmt::format("{}{}", prefix, group.other_name)))
        continue;
      known = true;
      // A group may have been asked for by its other name.
      const std::int32_t known_column = element.properties[group.properties[0]].column;
      const std::size_t first = known_column >= 0 ? static_cast<std::size_t>(known_column) : 3 * found.size();
      for (std::size_t k = 0; k < group.properties.size(); ++k)
        element.properties[group.properties[k]].column = static_cast<std::int32_t>(first + k);
      found.push_back({full, group.properties.size(), first});
    }
    if (known) continue;
    Error error = input_error(fmt::format("the PLY file has no attribute '{}'", full)).at(name, 0);
    if (others.empty())
      return std::move(error).with_mend("its " + element.name +
                                        " element has no colors and no numbers named like heat_0");
    return std::move(error).with_mend("there is " + others);
  }
  return {};
}

}  // namespace candela::loaders::ply
