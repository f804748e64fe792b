// Figures that a master tells over HTTP.
#pragma once

#include <string>

namespace candela::farm {

// The answer to "GET path" from HOST:PORT of loopback.
std::string http_get(const std::string& address, const std::string& path);

// The value of the line of a metric whose labels contain `label`; of a metric without labels, if that is
// empty.
double metric(const std::string& page, const std::string& name, const std::string& label = {});

}  // namespace candela::farm
