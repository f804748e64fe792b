// The paths that the light path expression of a session selects.
#pragma once

#include <cstddef>

#include "worker/inspect/session.h"

namespace candela::inspect {

// True if the light of one color channel (0 to 2) is selected.
bool is_selected(const Session& session, const RecordedPath& path, std::size_t channel);

}  // namespace candela::inspect
