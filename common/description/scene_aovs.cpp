#include "common/description/scene_aovs.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/description/check.h"
#include "common/edits/edits.h"
#include "common/job/aov.h"
#include "common/letters/request.h"

namespace candela::description {
namespace {

// Mitsuba separates entries by commas and spaces.
std::vector<std::string_view> entries_of(std::string_view list) {
  constexpr std::string_view kSeparators = ", \t\n";
  std::vector<std::string_view> entries;
  for (std::size_t begin = list.find_first_not_of(kSeparators); begin != std::string_view::npos;) {
    const std::size_t end = std::min(list.find_first_of(kSeparators, begin), list.size());
    entries.push_back(list.substr(begin, end - begin));
    begin = list.find_first_not_of(kSeparators, end);
  }
  return entries;
}

}  // namespace

Result<std::string> aovs_of_scene(const Property& aovs, bool lenient, std::vector<Note>& passed_over) {
  if (!std::holds_alternative<std::string>(aovs.value))
    return error_at(aovs.where, "the parameter 'aovs' of integrator 'aov' is no string");
  std::string kept;
  for (const std::string_view entry : entries_of(std::get<std::string>(aovs.value))) {
    const std::string longer = fmt::format("{}{}{}", kept, kept.empty() ? "" : ",", entry);
    if (const auto parsed = parse_aovs(longer); parsed.ok()) {
      kept = text_of(*parsed);
    } else if (lenient) {
      passed_over.push_back({aovs.where, parsed.error().message + ": it is passed over"});
    } else {
      Error error = error_at(aovs.where, parsed.error().message);
      error.mend = parsed.error().mend;
      return error;
    }
  }
  return kept;
}

Result<std::string> layers_of_scene(const Property& layers) {
  if (!std::holds_alternative<std::string>(layers.value))
    return error_at(layers.where, "the parameter 'layers' of integrator 'lpe' is no string");
  const auto request = letters::parse_layer_request(std::get<std::string>(layers.value));
  if (request.ok()) return letters::text_of(*request);
  return error_at(layers.where, request.error().message).with_mend(request.error().mend);
}

Result<std::string> read_scene_edits(const Property& edits) {
  if (!std::holds_alternative<std::string>(edits.value))
    return error_at(edits.where, "the parameter 'edits' of integrator 'edits' is no string");
  const auto list = edits::parse_edits(std::get<std::string>(edits.value));
  if (list.ok()) return edits::text_of(*list);
  std::string message = list.error().message;
  if (!list.error().field.empty()) message = fmt::format("{}: {}", list.error().field, message);
  return error_at(edits.where, message).with_mend(list.error().mend);
}

Result<void> add_requests(const Object& integrator, bool lenient, std::vector<Note>& passed_over,
                          SceneRequests& requests) {
  if (integrator.plugin == "aov" && requests.aovs.empty()) {
    if (const Property* aovs = integrator.find("aovs")) {
      CANDELA_ASSIGN(requests.aovs, aovs_of_scene(*aovs, lenient, passed_over));
    }
  }
  const auto only = [&](const char* name, const char* example) -> Result<const Property*> {
    const Property* property = integrator.find(name);
    if (property != nullptr && integrator.properties.size() == 1) return property;
    return error_at(integrator.where, fmt::format("an integrator '{}' has one parameter, the string '{}'",
                                                  integrator.plugin, name))
        .with_mend(fmt::format("write <string name=\"{}\" value={}/>", name, example));
  };
  if (integrator.plugin == "lpe" && requests.layers.empty()) {
    CANDELA_ASSIGN(const Property* layers, only("layers", "\"layer NAME=EXPR; ...\""));
    CANDELA_ASSIGN(requests.layers, layers_of_scene(*layers));
  }
  if (integrator.plugin == "edits" && requests.edits.empty()) {
    CANDELA_ASSIGN(const Property* edits, only("edits", "'{\"edits\": [...]}'"));
    CANDELA_ASSIGN(requests.edits, read_scene_edits(*edits));
  }
  return {};
}

bool is_layer_element(std::string_view plugin) {
  return plugin == "aov" || plugin == "lpe" || plugin == "edits";
}

}  // namespace candela::description
