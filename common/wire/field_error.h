// The error of a message's field.
#pragma once

#include <string>
#include <string_view>
#include <utility>

#include "common/base/result.h"

namespace candela::wire {

inline Error field_error(std::string_view field, std::string message) {
  return input_error(std::move(message)).with_field(std::string(field));
}

}  // namespace candela::wire
