// The parameters of a pbrt directive: "type name" [ values ].
#pragma once

#include <initializer_list>
#include <memory>
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
  Charge charge;  // of all this
};

// Parameters by name that others share. A copy is as quick as that of a pointer, and adding one to a copy
// leaves the others as they are: persistent balanced trees.
class SharedParameters {
 public:
  // Adds the parameter, or puts it in the place of one of its name. Errors: beyond the budget.
  Result<void> add(std::shared_ptr<const Parameter> parameter, ReadingBudget& budget);

  const std::shared_ptr<const Parameter>* find(std::string_view name) const;  // nullptr: none
  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }

 private:
  struct Node;
  using NodePtr = std::shared_ptr<const Node>;
  static int height(const NodePtr& node);
  static NodePtr join(std::shared_ptr<const Parameter> parameter, NodePtr left, NodePtr right,
                      ReadingBudget& budget, bool& fits);
  static NodePtr balance(std::shared_ptr<const Parameter> parameter, NodePtr left, NodePtr right,
                         ReadingBudget& budget, bool& fits);
  static NodePtr insert(const NodePtr& node, std::shared_ptr<const Parameter> parameter,
                        ReadingBudget& budget, bool& fits);

  NodePtr root_;
  std::size_t size_ = 0;
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

  // Values of Attribute directives count where the list has none of the name. They need not fit.
  void set_defaults(const SharedParameters& defaults) { defaults_ = defaults; }
  // Gives all parameters to the defaults of others.
  Result<void> add_to(SharedParameters& defaults, ReadingBudget& budget) const;

  bool has(std::string_view name) const;
  bool is_only(std::initializer_list<std::string_view> names) const;
  // The first of these parameters that another file than `file` gives; nullptr: none.
  const Parameter* given_outside(const std::string& file,
                                 std::initializer_list<std::string_view> names) const;
  // Drops the values of own lists that fill much memory: a loader reads them again.
  void forget_long_lists();
  // Values that a later one of the same name replaced.
  std::vector<Note> take_replaced() { return std::move(replaced_); }

 private:
  struct Entry {
    std::shared_ptr<Parameter> parameter;
    bool used = false;
  };
  bool has_own(std::string_view name) const;

  std::vector<Entry> all_;
  std::size_t next_unused_ = 0;  // those before it are used
  SharedParameters defaults_;
  std::vector<std::string> asked_;
  std::vector<Note> replaced_;
};

}  // namespace candela::description::pbrt
