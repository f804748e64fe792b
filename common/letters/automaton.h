// All expressions of a job as one deterministic automaton that reads paths from the light, its reverse for
// walks from the eye, and a table that tells the expressions a path matches where the two meet.
//
// Reverse: a state is the function that maps each forward state, which a prefix leads to, to the label of the
// whole path. The empty suffix maps a state to the state's own label; reading one vertex more, towards the
// light, is S'[q] = S[forward(q, class)].
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/base/result.h"
#include "common/letters/alphabet.h"
#include "common/letters/nfa.h"
#include "common/letters/request.h"

namespace candela::letters {

class Automaton {
 public:
  using State = std::uint16_t;
  using Class = Alphabet::Class;
  using Label = std::uint16_t;
  struct Counts {
    std::size_t classes = 0, nfa = 0, dfa = 0, minimal = 0, reverse = 0, table = 0;
  };
  static constexpr std::size_t kMaxStates = 1024;

  // `objects`: names of the objects by their index. `uses`: the ObjectUse of each, which sharpens errors and
  // the verdict on a partition; empty: an object can be any vertex. Errors (input): those of check(), a
  // {name} that no object has, an expression that no path can match, more than kMaxStates states forward or
  // reverse, and layers that are no partition where one is asked for. Precondition: light groups are
  // expanded.
  static Result<Automaton> compile(const LayerRequest& request, std::span<const ObjectNames> objects,
                                   std::span<const std::uint8_t> uses = {});

  State forward_start() const { return 0; }                 // before L
  State reverse_start() const { return after_eye_; }        // E has been read
  State reverse_before_eye() const { return before_eye_; }  // nothing has been read
  Class class_of(Letter letter, Side side, std::uint32_t object, std::uint32_t regions) const {
    return alphabet_.class_of(letter, side, object, regions);
  }
  // The vertex after those that led to the state, away from the light.
  State forward(State q, Class c) const { return forward_[q * counts_.classes + c]; }
  // The vertex before those that led to the state, away from the eye.
  State reverse(State r, Class c) const { return reverse_[r * counts_.classes + c]; }
  // Label of the path that joins the vertices of `q` and of `r`. 0: the path matches no expression.
  Label label(State q, State r) const { return table_[r * counts_.minimal + q]; }
  // Indexes into request.layers, increasing.
  std::span<const std::uint8_t> layers(Label label) const { return layers_[label]; }
  std::size_t label_count() const { return layers_.size(); }
  const Counts& counts() const { return counts_; }

 private:
  explicit Automaton(Alphabet alphabet) : alphabet_(std::move(alphabet)) {}
  void set_forward(const Dfa& dfa);
  bool set_reverse();  // false: more than kMaxStates

  Alphabet alphabet_;
  Counts counts_;
  State before_eye_ = 0, after_eye_ = 0;
  std::vector<State> forward_, reverse_;  // [state * classes + class]
  std::vector<Label> labels_;             // [forward state]: of the string that led to it
  std::vector<Label> table_;              // [reverse state * minimal + forward state]
  std::vector<std::vector<std::uint8_t>> layers_;
};

}  // namespace candela::letters
