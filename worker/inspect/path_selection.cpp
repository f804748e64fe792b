#include "worker/inspect/path_selection.h"

namespace candela::inspect {

bool is_selected(const Session& session, const RecordedPath& path, std::size_t channel) {
  if (!session.selects()) return true;
  const letters::Automaton& automaton = session.automaton();
  letters::Automaton::State state = automaton.forward_start();
  for (std::size_t i = 0; i + 1 < path.size(); ++i) {
    const PathVertex& v = path[i];
    const std::uint32_t regions = i == 0 ? 0 : session.regions_at(v.p);
    state =
        automaton.forward(state, automaton.class_of(v.letter[channel], v.side, v.object[channel], regions));
  }
  return !automaton.layers(automaton.label(state, automaton.reverse_start())).empty();
}

}  // namespace candela::inspect
