// Text helpers of the scene parser: numbers without locale, lists of numbers, names, and quoting for
// messages.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/nearest_name.h"
#include "common/base/text.h"

namespace candela::description::text {

// Whole-string conversions, with surrounding spaces allowed; nullopt for anything else, for overflow and for
// numbers that are not finite. A leading '+' is allowed, as by strtod.
std::optional<double> to_number(std::string_view text);
std::optional<std::int64_t> to_integer(std::string_view text);
std::optional<bool> to_boolean(std::string_view text);  // true or false, in any case

// Pieces between commas and white space; empty pieces are left out.
std::vector<std::string_view> tokens(std::string_view text);

std::string lower(std::string_view text);  // ASCII

// "toWorld" -> "to_world", "intIOR" -> "int_ior"; a name that is snake case already is returned as it is.
std::string snake_case(std::string_view name);

using candela::did_you_mean;
using candela::is_utf8;
using candela::quote;

// "'a', 'b', 'c'"
std::string quoted_list(const std::vector<std::string_view>& names);

}  // namespace candela::description::text
