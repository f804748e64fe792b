// The settings of an integrator, for `candela help INTEGRATOR`.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "client/settings.h"

namespace candela::client {

std::string integrator_help(const std::string& integrator, const std::vector<IntegratorSetting>& settings,
                            std::optional<std::size_t> width);

}  // namespace candela::client
