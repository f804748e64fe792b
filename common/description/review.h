// Lists what a scene uses, and the part that a reader of Mitsuba's documentation would not expect here.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "common/description/object.h"

namespace candela::description {

struct Finding {
  enum class Kind {
    differs,  // the picture is another than Mitsuba's
    dark,     // the picture is black, as Mitsuba's is
    missing,  // light that the integrator never finds
    ignored,  // a parameter that changes nothing in the picture
    unused    // an object that nothing uses
  };
  Kind kind{};
  Location where;
  std::string text;
  std::uint64_t count = 1;  // of the places that the same is true of; `where` is the first
};
std::string_view name(Finding::Kind kind);
// True if it is one of the first two kinds. The others are notes.
bool is_warning(Finding::Kind kind);

struct Review {
  // category -> plugin -> number of objects that the picture depends on, each counted once
  std::map<std::string, std::map<std::string, std::uint64_t>> uses;
  std::vector<Finding> findings;  // by file and line
};

// The notes of the parser, the rules' `differs` and `ignored`, and objects that only stand there. Of several
// sensors or integrators the first is the one that counts.
Review review(const SceneDescription& scene);

}  // namespace candela::description
