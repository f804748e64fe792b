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

// True for a file before version 2. `otherwise`: the answer if the root names no version.
Result<bool> is_legacy(const XmlDocument& document, const pugi::xml_node& root, bool otherwise);

// The name of a parameter as Mitsuba 3 spells it.
std::string modern_name(bool legacy, std::string_view name);

// Leading underscores are Mitsuba's own.
Result<void> check_name(const Element& element, std::string_view attribute);

// The matrix is finite and invertible.
Result<void> check_transform(const Element& written, const Mat4& matrix);

// Refuse a node that is no element, and a node with children.
Result<void> expect_element(const XmlDocument& document, const pugi::xml_node& node);
Result<void> no_children(const XmlDocument& document, const pugi::xml_node& node);

// The error of text where elements belong, which names it where it begins, behind white space.
Error unexpected_text(const XmlDocument& document, const pugi::xml_node& node);

}  // namespace candela::description
