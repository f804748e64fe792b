// The parameters of a pbrt directive: "type name" [ values ].
#pragma once

#include <array>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/description/pbrt/tokens.h"

namespace candela::description::pbrt {

struct Parameter {
  std::string type, name;
  Location where;
  std::vector<double> numbers;
  std::vector<std::string> strings;
  std::vector<bool> flags;
  bool used = false;
};

// Remembers which parameters were asked for: what nobody asks for is unknown.
class ParameterList {
 public:
  // Reads parameters up to the next directive. Of several values of one name the last one counts, as in pbrt.
  static Result<ParameterList> read(Tokens& tokens);

  // The parameter of this name, if it has one of these types; it counts as used. nullptr if absent.
  const Parameter* take(std::string_view name, std::initializer_list<std::string_view> types);

  // One value of a parameter. Errors: several values.
  Result<double> number(std::string_view name, double otherwise);
  Result<std::int64_t> integer(std::string_view name, std::int64_t otherwise);
  Result<bool> flag(std::string_view name, bool otherwise);
  Result<std::string> text(std::string_view name, std::string_view otherwise);
  Result<Vec3> point(std::string_view name, const Vec3& otherwise);
  // Nothing if absent.
  Result<std::optional<double>> optional_number(std::string_view name);

  // Accepts a parameter and does nothing with it.
  void ignore(std::initializer_list<std::string_view> names);

  // The error of the first parameter that nobody asked for, with the nearest name. `of`: "material
  // 'diffuse'".
  std::optional<Error> first_unused(std::string_view of);

  // Values of an Attribute directive, where the list has none of the name.
  void add_defaults(const ParameterList& defaults);
  void append(const ParameterList& more);

  bool has(std::string_view name) const;
  bool is_only(std::initializer_list<std::string_view> names) const;
  // The first of these parameters that another file than `file` gives; nullptr: none.
  const Parameter* given_outside(const std::string& file,
                                 std::initializer_list<std::string_view> names) const;
  // Drops the values of lists that fill much memory: a loader reads them again.
  void forget_long_lists();
  // Values that a later one of the same name replaced.
  std::vector<Note> take_replaced() { return std::move(replaced_); }
  bool empty() const { return all_.empty(); }

 private:
  std::vector<Parameter> all_;
  std::vector<std::string> asked_;
  std::vector<Note> replaced_;
};

}  // namespace candela::description::pbrt
