// Edits of light transport that a job asks for [Kaplanyan 2017, section 9.2], and their text in the job's
// settings. An edit selects vertices of paths by a light path expression, and turns the directions in which
// they scatter light. docs/edits.md explains the keys.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/job/job.h"
#include "common/letters/request.h"

namespace candela::edits {

using Triple = std::array<double, 3>;

struct Rotation {
  Triple axis{};  // not zero; of any length
  double degrees = 0;
  bool operator==(const Rotation&) const = default;
};

// y -> to + linear (y - from), for the points y of the plane through `from` with `normal`.
struct Move {
  Triple from{}, to{};
  std::array<double, 9> linear = {1, 0, 0, 0, 1, 0, 0, 0, 1};  // row by row
  std::optional<Triple> normal;                                // nothing: the plane faces the vertex
  bool operator==(const Move&) const = default;
};

struct Edit {
  // light: it turns light that leaves the vertex, and the expression is that of the path up to there. eye: it
  // turns where the vertex gathers light from, and the expression is that of the path from there.
  enum class Direction : std::uint8_t { light, eye };
  std::string name;
  Direction direction = Direction::light;
  std::string select;
  std::string source;  // the region that directions have to aim at; empty: all directions
  bool hit = false;    // the first surface in a direction has to lie in the source
  std::optional<Rotation> rotate;
  std::optional<Move> move;  // at most one of the two
  Triple factor = {1, 1, 1};

  bool operator==(const Edit&) const = default;
};

struct EditList {
  std::vector<Edit> edits;               // in the order in which they act
  std::vector<letters::Region> regions;  // of sources, and of @NAME in expressions
  double glossy_below = letters::kDefaultGlossyBelow;

  bool empty() const { return edits.empty(); }
  const letters::Region* region(std::string_view name) const;
  bool operator==(const EditList&) const = default;
};

inline constexpr std::size_t kMaxEdits = 16;
inline constexpr std::size_t kMaxEditsBytes = 16384;  // of the text
inline constexpr double kMaxFactor = 1000;

// Reads JSON. Edits that change nothing are left out. "" is empty. Errors (input) name the key, and the line
// where the text is no JSON.
Result<EditList> parse_edits(std::string_view text);
// As parse_edits() reads it, on one line; "" if there is none.
std::string text_of(const EditList& list);

// The setting max_depth of an integrator; < 0: none.
int max_depth_of(const SettingsMap& integrator_settings);

// Fails (usage) if the integrator cannot render edits, or not these to any depth. `max_depth`: < 0: none.
Result<void> check_integrator(const EditList& list, std::string_view integrator, int max_depth);

}  // namespace candela::edits
