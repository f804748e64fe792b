// A property of a scene's element as settings maps hold it.
#pragma once

#include <optional>
#include <string>

#include "common/description/object.h"

namespace candela::description {

// As text; nullopt for what no setting can be. Numbers as the shortest text that reads back the same.
std::optional<std::string> setting_text(const Property& property);

}  // namespace candela::description
