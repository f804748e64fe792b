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

// "L [DGSV]* DR E", "L{lamp} X{wall} E"
std::string expression_of(const StringGroup& group, bool from_light, const Session& session);
// "L", "DR", "V{fog}", "X{wall}"
std::string text_of(const Token& token, const Session& session);

}  // namespace candela::inspect
