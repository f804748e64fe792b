// Groups of clusters whose paths have the same vertices next to one end.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "worker/inspect/path_sums.h"

namespace candela::inspect {

struct StringGroup {
  PathString common;   // next to the end, the end first
  bool whole = false;  // `common` is the whole string
  std::vector<const std::pair<const PathString, Cluster>*> members;
  double light = 0;  // absolute luminances
};

// At most `rows` groups (or as many as have the same end), most light first.
std::vector<StringGroup> group_strings(const std::map<PathString, Cluster>& clusters, bool from_light,
                                       std::size_t rows);

// The order of groups by their `common` in which each path is of the first group whose expression it matches:
// a name that more objects have comes later, and vertices without a name, which match all, last.
bool is_narrower(const PathString& a, const PathString& b, const Session& session);

// "L [DGSV]* DR E", "L{lamp} X{wall} E"
std::string expression_of(const StringGroup& group, bool from_light, const Session& session);
// "L", "DR", "V{fog}", "X{wall}"
std::string text_of(const Token& token, const Session& session);

}  // namespace candela::inspect
