// $parameters of a scene: given ones (-D) first, then the <default>s met so far.
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace candela::description {

class Parameters {
 public:
  explicit Parameters(const std::map<std::string, std::string>& given);

  // A <default>: counts only where the name has no value yet.
  void add_default(const std::string& name, const std::string& value);

  // Replaces every $name by its value, the longest known name first; "\$" is a plain dollar sign. Values are
  // not looked into again. No attribute grows beyond 16 MiB, nor all of them by more than 256 MiB. The error
  // says which name has no value (no location).
  Result<std::string> substitute(std::string_view text);

  // Given names that no substitution has used: an error naming one and the nearest name the scene knows.
  Result<void> check_all_used() const;

 private:
  struct Value {
    std::string text;
    bool given = false;
    bool used = false;
  };
  using Values = std::map<std::string, Value, std::less<>>;
  Values::iterator longest_name(std::string_view rest);

  Values values_;
  std::size_t total_bytes_ = 0;  // put into attributes so far
};

}  // namespace candela::description
