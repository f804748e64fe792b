#include "common/edits/path_states.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>

#include "common/edits/vertex_classes.h"
#include "common/letters/expression.h"

namespace candela::edits {
namespace {

using letters::Automaton;
using letters::Letter;
using letters::Side;

constexpr std::string_view name_of(Edit::Direction direction) {
  return direction == Edit::Direction::light ? "light" : "what is gathered";
}

}  // namespace

Result<PathStates> PathStates::compile(const EditList& list, Edit::Direction direction,
                                       std::span<const letters::ObjectNames> objects,
                                       std::span<const std::uint8_t> uses) {
  PathStates states;
  const bool of_light = direction == Edit::Direction::light;
  letters::LayerRequest request;
  request.regions = list.regions;
  request.glossy_below = list.glossy_below;
  std::vector<std::size_t> edit_of_layer;
  bool by_place = false;
  for (std::size_t k = 0; k < list.edits.size(); ++k) {
    if (list.edits[k].direction != direction) continue;
    edit_of_layer.push_back(k);
    request.layers.push_back({fmt::format("edit{}", k), whole_path(list.edits[k])});
    CANDELA_ASSIGN(const letters::Node tree, letters::parse_expression(list.edits[k].select));
    letters::for_each_token(tree, [&](const letters::Token& token) { by_place |= !token.region.empty(); });
  }
  if (request.layers.empty()) return states;
  const auto too_many = [&] {
    return input_error(fmt::format("the edits of {} together tell more than {} kinds of paths apart",
                                   name_of(direction), kMax))
        .with_mend("name fewer vertices before the edited one, or render with fewer edits");
  };
  auto compiled = Automaton::compile(request, objects, uses);
  if (!compiled.ok()) return too_many();
  const Automaton automaton = *std::move(compiled);
  const VertexClasses vertices(automaton, objects, uses, by_place ? request.regions.size() : 0);

  const auto step = [&](std::uint32_t state, Class c) -> std::uint32_t {
    return of_light ? automaton.forward(static_cast<Automaton::State>(state), c)
                    : automaton.reverse(static_cast<Automaton::State>(state), c);
  };
  const auto at_lamp = [&](Class lamp) { return automaton.forward(automaton.forward_start(), lamp); };
  const auto bits_of = [&](Automaton::Label label) {
    Edits bits = 0;
    for (const std::uint8_t layer : automaton.layers(label))
      bits |= static_cast<Edits>(1u << edit_of_layer[layer]);
    return bits;
  };
  // The edits that select the vertex that led to the state.
  const auto accepted = [&](std::uint32_t state) {
    const auto at = static_cast<Automaton::State>(state);
    if (of_light) return bits_of(automaton.label(at, automaton.reverse_start()));
    Edits bits = 0;
    for (const Class lamp : vertices.lamps) bits |= bits_of(automaton.label(at_lamp(lamp), at));
    return bits;
  };

  // All states that a walk may be in; the eye's is the first.
  std::vector<std::uint32_t> reached;
  std::map<std::uint32_t, std::size_t> place;
  const auto reach = [&](std::uint32_t state) {
    if (place.try_emplace(state, reached.size()).second) reached.push_back(state);
  };
  if (of_light)
    for (const Class lamp : vertices.lamps) reach(at_lamp(lamp));
  else
    reach(automaton.reverse_start());
  std::vector<Class> inner(vertices.surfaces.begin(), vertices.surfaces.end());
  inner.insert(inner.end(), vertices.media.begin(), vertices.media.end());
  for (std::size_t i = 0; i < reached.size(); ++i)
    for (const Class c : inner) reach(step(reached[i], c));

  // Blocks of states with equal verdicts, refined until all steps lead from a block to one block.
  std::vector<std::size_t> block(reached.size(), 0);
  std::size_t blocks = 1;
  for (;;) {
    std::map<std::vector<std::size_t>, std::size_t> known;
    std::vector<std::size_t> refined;
    for (std::size_t i = 0; i < reached.size(); ++i) {
      std::vector<std::size_t> signature = {block[i]};
      for (const Class c : inner) {
        const std::uint32_t to = step(reached[i], c);
        signature.push_back(accepted(to));
        signature.push_back(block[place.at(to)]);
      }
      refined.push_back(known.try_emplace(std::move(signature), known.size()).first->second);
    }
    block = std::move(refined);
    if (known.size() == blocks) break;
    blocks = known.size();
  }
  if (blocks > kMax) return too_many();
  states.size_ = std::max<std::size_t>(blocks, 1);
  states.classes_ = automaton.counts().classes;
  states.next_.assign(states.size_ * states.classes_, 0);
  states.selected_.assign(states.size_ * states.classes_, 0);
  for (std::size_t i = 0; i < reached.size(); ++i)
    for (const Class c : inner) {
      const std::uint32_t to = step(reached[i], c);
      states.next_[block[i] * states.classes_ + c] = static_cast<State>(block[place.at(to)]);
      states.selected_[block[i] * states.classes_ + c] = accepted(to);
    }
  if (of_light) {
    states.lamps_.assign(objects.size(), 0);
    for (std::uint32_t object = 0; object < objects.size(); ++object)
      if (uses.empty() || (uses[object] & letters::kLampObject) != 0)
        states.lamps_[object] = static_cast<State>(
            block[place.at(at_lamp(automaton.class_of(Letter::lamp, Side::none, object, 0)))]);
  }
  states.automaton_.push_back(automaton);
  return states;
}

}  // namespace candela::edits
