// Vertices that an edit selects: from the vertex alone, by an expression such as LX*S{mirror} ("light, by
// any way, and last the mirror"), or X{wall}X*E for what the eye gathers; or by more of the path
// (path_states.h). The vertex is a surface, or a place in a medium (V); of an edit of light it may be the
// lamp itself (L{sun}).
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/edits/edits.h"
#include "common/letters/automaton.h"

namespace candela::edits {

class Selection {
 public:
  // objects, uses: as letters::Automaton::compile() has them. Errors (input) name the edit, and the column of
  // the expression.
  static Result<Selection> compile(const EditList& list, const Edit& edit,
                                   std::span<const letters::ObjectNames> objects,
                                   std::span<const std::uint8_t> uses);

  // The verdict on a vertex depends on other vertices.
  bool by_path() const { return by_path_; }
  // Preconditions: not by_path(); `object` is that of a surface, or with Letter::volume of a medium.
  // regions: bit i is set inside region i of the list.
  bool selects(letters::Letter letter, letters::Side side, std::uint32_t object,
               std::uint32_t regions) const {
    std::uint32_t own = 0;
    for (std::size_t i = 0; i < regions_.size(); ++i) own |= (regions >> regions_[i] & 1u) << i;
    return selected_[automaton_.class_of(letter, side, object, own)] != 0;
  }
  // Light that lamps of this object emit is selected.
  bool selects_lamp(std::uint32_t object) const;

 private:
  Selection(letters::Automaton automaton, std::vector<std::uint8_t> regions, bool of_light)
      : automaton_(std::move(automaton)), regions_(std::move(regions)), of_light_(of_light) {}

  letters::Automaton automaton_;
  std::vector<std::uint8_t> regions_;   // of the list, by the bit that the automaton has for them
  std::vector<std::uint8_t> selected_;  // by class
  bool of_light_;
  bool by_path_ = false;
};

// Fails (input) if edits that select by more of the path than the vertex tell too many paths apart;
// selections are those of the list's edits.
Result<void> check_by_path(const EditList& list, std::span<const Selection> selections,
                           std::span<const letters::ObjectNames> objects, std::span<const std::uint8_t> uses);
// The error (input) of whatever reads letters, if such edits change for some paths only a surface that
// scatters by D and G at once. surface: as messages name it.
Error letters_not_known(const std::string& surface);

}  // namespace candela::edits
