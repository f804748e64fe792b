// Classes of vertices: two vertices are of one class if no expression of a job tells them apart.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/letters/expression.h"
#include "common/letters/letter.h"

namespace candela::letters {

// Names of one object: a shape's id, its material's id, a lamp's id, a medium's id. {name} matches the object
// if it matches any of them.
using ObjectNames = std::vector<std::string>;
// The object of vertices without names.
inline constexpr std::uint32_t kNoObject = std::numeric_limits<std::uint32_t>::max();
// Bits: the vertices that an object can be.
enum ObjectUse : std::uint8_t { kLampObject = 1, kSurfaceObject = 2, kMediumObject = 4 };

class Alphabet {
 public:
  using Class = std::uint16_t;
  // Place of a vertex on its path: first (L), inner (D, G, S, V), last (E).
  enum class Place : std::uint8_t { lamp, inner, eye };

  // `atoms`: all sets of the job's expressions. `uses` has the ObjectUse of each object, or is empty: any
  // object can be any vertex. Preconditions: every name in `atoms` is that of an object, every region is in
  // `regions`. Errors (input): too many combinations of names and regions.
  static Result<Alphabet> make(std::span<const Set> atoms, std::span<const std::string> regions,
                               std::span<const ObjectNames> objects, std::span<const std::uint8_t> uses);

  // regions: bit i is set inside region i. Side::none is Side::reflected at D, G and S, and sides count
  // nowhere else.
  Class class_of(Letter letter, Side side, std::uint32_t object, std::uint32_t regions) const {
    const std::uint32_t kind = object < kinds_.size() ? kinds_[object] : 0;
    const std::size_t symbol = kSymbols[static_cast<std::size_t>(letter)][static_cast<std::size_t>(side)];
    return classes_[((kind * kSymbolCount + symbol) << region_bits_) + (regions & region_mask_)];
  }

  std::size_t size() const { return places_.size(); }
  Place place(Class c) const { return places_[c]; }
  // A vertex of the class can be in the scene.
  bool possible(Class c) const { return possible_[c]; }
  bool matches(std::size_t atom, Class c) const { return (accepted_[c][atom / 64] >> (atom % 64) & 1) != 0; }
  // A vertex of the class, as a token: "DR{wall}@box".
  const std::string& example(Class c) const { return examples_[c]; }

 private:
  // L, E, V, DR, DT, GR, GT, SR, ST.
  static constexpr std::size_t kSymbolCount = 9;
  // [letter][side]
  static constexpr std::array<std::array<std::uint8_t, 3>, 6> kSymbols = {
      {{0, 0, 0}, {1, 1, 1}, {3, 3, 4}, {5, 5, 6}, {7, 7, 8}, {2, 2, 2}}};

  std::uint32_t region_bits_ = 0, region_mask_ = 0;
  std::vector<std::uint32_t> kinds_;  // of objects: equal kinds match the same names; 0 matches none
  std::vector<Class> classes_;        // [kind][symbol][regions]
  std::vector<Place> places_;         // of classes, as all below
  std::vector<std::uint8_t> possible_;
  std::vector<std::vector<std::uint64_t>> accepted_;  // bit a: atom a matches
  std::vector<std::string> examples_;
};

}  // namespace candela::letters
