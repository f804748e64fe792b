// Selections by more of a path than the edited vertex, such as LX*S{glass}D{floor}: the states that a walk
// has to know, one of a few [retargeting note, section 7]. Edits of light read the vertices from the lamp up
// to the edited one; edits of the eye read them from the lens.
//
// A machine of Mealy's kind: the verdict stands on the step over the edited vertex, so that two states fall
// together if all continuations give them equal verdicts. Selections by the vertex alone have one state.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/base/result.h"
#include "common/edits/edits.h"
#include "common/letters/automaton.h"

namespace candela::edits {

class PathStates {
 public:
  using Class = letters::Automaton::Class;
  using State = std::uint8_t;
  using Edits = std::uint16_t;  // bit k: edit k of the list
  static constexpr std::size_t kMax = 16;

  // Compiles the list's edits of one direction. objects, uses: as for letters::Automaton::compile(). Errors
  // (input): more than kMax states. Precondition: Selection::compile() takes each edit.
  static Result<PathStates> compile(const EditList& list, Edit::Direction direction,
                                    std::span<const letters::ObjectNames> objects,
                                    std::span<const std::uint8_t> uses);

  std::size_t size() const { return size_; }
  // Before the first vertex that scatters: seen from the lens, or from the lamp of this object.
  State at_eye() const { return 0; }
  State at_lamp(std::uint32_t object) const { return lamps_.empty() ? State{0} : lamps_[object]; }

  // regions: bit i is set inside region i of the list.
  Class class_of(letters::Letter letter, letters::Side side, std::uint32_t object,
                 std::uint32_t regions) const {
    return automaton_.empty() ? Class{0} : automaton_[0].class_of(letter, side, object, regions);
  }
  // The state behind a vertex of class c, and the edits that select this vertex, if a walk comes in `state`.
  State next(State state, Class c) const { return next_[state * classes_ + c]; }
  Edits selected(State state, Class c) const { return selected_[state * classes_ + c]; }

 private:
  PathStates() = default;

  std::size_t size_ = 1, classes_ = 1;
  std::vector<letters::Automaton> automaton_;  // none: no edits of the direction
  std::vector<State> next_ = {0};              // [state * classes_ + class]
  std::vector<Edits> selected_ = {0};          // likewise
  std::vector<State> lamps_;                   // by object
};

}  // namespace candela::edits
