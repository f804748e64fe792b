// Values of JSON for scripts: the rules that all of `--json` keeps.
#pragma once

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include "common/base/text.h"

namespace candela::wire {

using Json = nlohmann::ordered_json;  // keys keep their order

// Indented text; unprintable characters are escaped, text that is not UTF-8 is mended.
inline std::string json_text(const Json& json) {
  return escape_json_unprintable(json.dump(2, ' ', false, Json::error_handler_t::replace));
}

// An unknown number (NaN, infinite) is null.
inline Json finite(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

}  // namespace candela::wire
