#include "common/edits/selection.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <set>
#include <string_view>
#include <utility>

#include "common/edits/path_states.h"
#include "common/edits/vertex_classes.h"
#include "common/letters/expression.h"

namespace candela::edits {
namespace {

using letters::Automaton;
// The name under which the automaton knows the expression.
constexpr std::string_view kLayer = "edit";

// Turns the automaton's error on a layer into one on the edit. `before`: bytes that stand before the user's.
Error error_of(const Edit& edit, Error error, std::size_t before) {
  const std::string layer = fmt::format("layer '{}'", kLayer);
  std::string_view rest = error.message;
  if (rest.starts_with(layer)) rest.remove_prefix(layer.size());
  constexpr std::string_view column = ", column ";
  std::size_t number = 0;
  std::string text(rest);
  if (rest.starts_with(column)) {
    const auto [end, code] = std::from_chars(rest.data() + column.size(), rest.data() + rest.size(), number);
    if (code == std::errc() && number > before)
      text = fmt::format("{}{}{}", column, number - before,
                         std::string_view(end, static_cast<std::size_t>(rest.data() + rest.size() - end)));
  }
  if (rest == " matches no path") {
    text = fmt::format(" selects no vertex by '{}'", edit.select);
    error.mend =
        edit.direction == Edit::Direction::light
            ? "an edit of light begins with L and ends with the edited vertex: LX*S{mirror}"
            : "an edit of what is gathered begins with the edited vertex and ends with E: X{wall}X*E";
  }
  error.message = fmt::format("edit '{}'{}", edit.name, text);
  return error;
}

Error refusal(const Edit& edit, std::string_view why, std::string mend) {
  return input_error(fmt::format("edit '{}': '{}' {}", edit.name, edit.select, why))
      .with_mend(std::move(mend));
}

}  // namespace

Result<Selection> Selection::compile(const EditList& list, const Edit& edit,
                                     std::span<const letters::ObjectNames> objects,
                                     std::span<const std::uint8_t> uses) {
  const bool of_light = edit.direction == Edit::Direction::light;
  letters::LayerRequest request;
  request.layers = {{std::string(kLayer), whole_path(edit)}};
  std::vector<std::uint8_t> bits;
  const auto tree = letters::parse_expression(edit.select);
  if (!tree.ok()) return refusal(edit, "is no expression: " + tree.error().message, "");
  letters::for_each_token(*tree, [&](const letters::Token& token) {
    for (std::size_t r = 0; r < list.regions.size(); ++r)
      if (list.regions[r].name == token.region && std::find(bits.begin(), bits.end(), r) == bits.end()) {
        bits.push_back(static_cast<std::uint8_t>(r));
        request.regions.push_back(list.regions[r]);
      }
  });
  request.glossy_below = list.glossy_below;
  if (auto checked = letters::check(request); !checked.ok())
    return error_of(edit, std::move(checked).error(), bytes_before(edit));
  auto compiled = Automaton::compile(request, objects, uses);
  if (!compiled.ok()) return error_of(edit, std::move(compiled).error(), bytes_before(edit));
  Selection selection(*std::move(compiled), std::move(bits), of_light);
  const Automaton& automaton = selection.automaton_;

  const VertexClasses vertices(automaton, objects, uses, request.regions.size());

  // All states that a walk may be in when it comes to the vertex, from the edit's end.
  const auto step = [&](std::uint32_t state, Automaton::Class c) -> std::uint32_t {
    return of_light ? automaton.forward(static_cast<Automaton::State>(state), c)
                    : automaton.reverse(static_cast<Automaton::State>(state), c);
  };
  std::set<std::uint32_t> starts, reached;
  if (of_light)
    for (const Automaton::Class lamp : vertices.lamps)
      starts.insert(automaton.forward(automaton.forward_start(), lamp));
  else
    starts.insert(automaton.reverse_start());
  std::vector<std::uint32_t> open(starts.begin(), starts.end());
  reached = starts;
  for (std::size_t i = 0; i < open.size(); ++i)
    for (const auto* tokens : {&vertices.surfaces, &vertices.media})
      for (const Automaton::Class c : *tokens)
        if (const std::uint32_t next = step(open[i], c); reached.insert(next).second) open.push_back(next);

  const auto accepts = [&](std::uint32_t state, Automaton::Class c) {
    const std::uint32_t at = step(state, c);
    if (of_light) return automaton.label(static_cast<Automaton::State>(at), automaton.reverse_start()) != 0;
    for (const Automaton::Class lamp : vertices.lamps)
      if (automaton.label(automaton.forward(automaton.forward_start(), lamp),
                          static_cast<Automaton::State>(at)) != 0)
        return true;
    return false;
  };
  selection.selected_.assign(automaton.counts().classes, 0);
  bool any = false;
  for (const std::uint32_t state : open)
    for (const auto* tokens : {&vertices.surfaces, &vertices.media})
      for (const Automaton::Class c : *tokens) {
        const auto verdict = static_cast<std::uint8_t>(accepts(state, c) ? 1 : 2);
        std::uint8_t& known = selection.selected_[c];
        selection.by_path_ |= known != 0 && known != verdict;
        known = verdict;
        any |= verdict == 1;
      }
  for (std::uint32_t object = 0; object < objects.size() && !any; ++object)
    any = (uses.empty() || (uses[object] & letters::kLampObject) != 0) && selection.selects_lamp(object);
  if (!any && !open.empty() && !vertices.surfaces.empty())
    return refusal(
        edit, "selects no vertex",
        of_light ? "end with the edited vertex: LX*D{wall}" : "begin with the edited vertex: X{wall}X*E");
  for (std::uint8_t& verdict : selection.selected_) verdict = verdict == 1 ? 1 : 0;
  return selection;
}

bool Selection::selects_lamp(std::uint32_t object) const {
  if (!of_light_) return false;
  const Automaton::State behind = automaton_.forward(
      automaton_.forward_start(), automaton_.class_of(letters::Letter::lamp, letters::Side::none, object, 0));
  return automaton_.label(behind, automaton_.reverse_start()) != 0;
}

Result<void> check_by_path(const EditList& list, std::span<const Selection> selections,
                           std::span<const letters::ObjectNames> objects,
                           std::span<const std::uint8_t> uses) {
  if (std::none_of(selections.begin(), selections.end(),
                   [](const Selection& selection) { return selection.by_path(); }))
    return {};
  for (const Edit::Direction direction : {Edit::Direction::light, Edit::Direction::eye})
    CANDELA_TRY(PathStates::compile(list, direction, objects, uses));
  return {};
}

Error letters_not_known(const std::string& surface) {
  return input_error(fmt::format("the surface {} scatters by D and G at once, and edits change it for some "
                                 "paths only: its letter is not known to layers and to inspect",
                                 surface))
      .with_field("edits")
      .with_mend("render these edits without layers, or select from the vertex alone: LX*X{wall}");
}

}  // namespace candela::edits
