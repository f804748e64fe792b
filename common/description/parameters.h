// $parameters of a scene: given ones (-D) first, then the <default>s met so far.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"

namespace candela::description {

class Parameters {
 public:
  // `assumes_usual`: names with a usual value need no other (lenient.h).
  explicit Parameters(const std::map<std::string, std::string>& given, bool assumes_usual = false);
  void assume_usual(bool assumes) { assumes_usual_ = assumes; }

  // Names and values that were assumed since the last call.
  std::vector<std::pair<std::string, std::string>> take_assumed() { return std::exchange(assumed_, {}); }

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
  // The usual value of `name` becomes its value; values_.end() if there is none.
  Values::iterator assume(std::string_view name);

  Values values_;
  bool assumes_usual_ = false;
  std::vector<std::pair<std::string, std::string>> assumed_;
  std::size_t total_bytes_ = 0;  // put into attributes so far
};

}  // namespace candela::description
