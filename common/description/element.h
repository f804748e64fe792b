// An XML element with its $parameters resolved.
#pragma once

#include <pugixml.hpp>

#include "common/description/parameters.h"
#include "common/description/values.h"
#include "common/description/xml_document.h"

namespace candela::description {

// The node's attributes with parameters resolved. `legacy`: of a file before version 2.
Result<Element> read_element(const XmlDocument& document, const pugi::xml_node& node, bool legacy,
                             Parameters& parameters);

// The error of text where elements belong, which names it where it begins, behind white space.
Error unexpected_text(const XmlDocument& document, const pugi::xml_node& node);

}  // namespace candela::description
