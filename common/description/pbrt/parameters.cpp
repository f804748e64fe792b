#include "common/description/pbrt/parameters.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <unordered_map>

#include "common/base/work_monitor.h"
#include "common/description/check.h"
#include "common/description/text.h"
#include "common/description/vocabulary.h"

namespace candela::description::pbrt {
namespace {

enum class Kind { numbers, strings, flags, either };

struct Type {
  std::string_view name;
  Kind kind;
  std::size_t multiple;  // how many values make one
};

constexpr std::array<Type, 14> types = {{{"float", Kind::numbers, 1},
                                         {"integer", Kind::numbers, 1},
                                         {"point2", Kind::numbers, 2},
                                         {"vector2", Kind::numbers, 2},
                                         {"point3", Kind::numbers, 3},
                                         {"vector3", Kind::numbers, 3},
                                         {"normal", Kind::numbers, 3},
                                         {"normal3", Kind::numbers, 3},
                                         {"rgb", Kind::numbers, 3},
                                         {"blackbody", Kind::numbers, 1},
                                         {"string", Kind::strings, 1},
                                         {"texture", Kind::strings, 1},
                                         {"bool", Kind::flags, 1},
                                         {"spectrum", Kind::either, 1}}};

// Earlier versions' names of types.
constexpr std::array<std::pair<std::string_view, std::string_view>, 3> old_types = {
    {{"point", "point3"}, {"vector", "vector3"}, {"color", "rgb"}}};

const Type* find_type(std::string_view name) {
  const auto found =
      std::find_if(types.begin(), types.end(), [&](const Type& type) { return type.name == name; });
  return found == types.end() ? nullptr : &*found;
}

Error unknown_type(const Location& where, std::string_view name) {
  for (const auto& [old, now] : old_types)
    if (old == name)
      return error_at(where, fmt::format("the type {} is of pbrt's version 3", text::quote(name)))
          .with_mend(fmt::format("write '{}', or convert the file with pbrt --upgrade", now));
  std::vector<std::string_view> known;
  for (const Type& type : types) known.push_back(type.name);
  return error_at(where, fmt::format("unknown type of a parameter {}", text::quote(name)))
      .with_mend(text::did_you_mean(nearest_name(name, known)));
}

constexpr std::size_t max_replaced = 100'000;

// As vector's push_back(), with room that is asked for.
template <class T>
bool push(std::vector<T>& list, T value, Charge& charge) {
  if (list.size() == list.capacity()) {
    const std::size_t before = list.capacity(), after = std::max<std::size_t>(2 * before, 1);
    if (!charge.take(after * sizeof(T))) return false;
    list.reserve(after);
    charge.give_back(before * sizeof(T));
  }
  list.push_back(std::move(value));
  return true;
}

Error too_much(const Tokens& tokens, const Location& where) {
  return tokens.budget().refusal(where, "values of parameters", 0);
}

Result<void> add_value(Parameter& parameter, const Type& type, const Token& token, const Tokens& tokens) {
  const auto wrong = [&](std::string_view expected) {
    return error_at(tokens.where(token), fmt::format("{} is no {} (parameter {})", text::quote(token.text),
                                                     expected, text::quote(parameter.name)));
  };
  if (type.kind == Kind::flags) {
    const std::optional<bool> flag = text::to_boolean(token.text);
    if (!flag) return wrong("true or false");
    if (parameter.flags.size() == parameter.flags.capacity() &&
        !parameter.charge.take(std::max<std::size_t>(parameter.flags.capacity() / 4, 16)))
      return too_much(tokens, tokens.where(token));
    parameter.flags.push_back(*flag);
  } else if (type.kind == Kind::strings || (type.kind == Kind::either && token.quoted)) {
    if (!token.quoted) return wrong("string in quotes");
    const std::uint64_t bytes = token.text.size() > 15 ? token.text.size() + 17 : 0;
    if (!parameter.charge.take(bytes) || !push(parameter.strings, std::string(token.text), parameter.charge))
      return too_much(tokens, tokens.where(token));
  } else {
    const std::optional<double> number = token.quoted ? std::nullopt : text::to_number(token.text);
    if (!number) return wrong("finite number");
    if (type.name == "integer" && *number != std::floor(*number)) return wrong("whole number");
    if (!push(parameter.numbers, *number, parameter.charge)) return too_much(tokens, tokens.where(token));
  }
  return {};
}

// The next values of a list, as far as they are plain decimals.
Result<void> add_plain_decimals(Tokens& tokens, Parameter& parameter, bool whole) {
  while (const std::optional<double> decimal = tokens.next_plain_decimal(whole)) {
    work_step(parameter.numbers.size());
    if (!push(parameter.numbers, *decimal, parameter.charge)) return too_much(tokens, tokens.here());
  }
  return {};
}

Result<void> read_values(Tokens& tokens, Parameter& parameter, const Type& type) {
  CANDELA_ASSIGN(std::optional<Token> token, tokens.next());
  const bool list = token && !token->quoted && token->text == "[";
  for (std::size_t i = 0;; ++i) {
    work_step(i);
    if (list) {
      if (type.kind == Kind::numbers)
        CANDELA_TRY(add_plain_decimals(tokens, parameter, type.name == "integer"));
      CANDELA_ASSIGN(token, tokens.next());
    }
    if (!token)
      return error_at(tokens.here(), fmt::format("the file ends within the values of parameter {}",
                                                 text::quote(parameter.name)));
    if (list && !token->quoted && token->text == "]") break;
    CANDELA_TRY(add_value(parameter, type, *token, tokens));
    if (!list) break;
  }
  const std::size_t count = parameter.numbers.size();
  if (!parameter.numbers.empty() && (!parameter.strings.empty() || count % type.multiple != 0))
    return error_at(parameter.where,
                    fmt::format("parameter {} has {} numbers, but a {} has {}", text::quote(parameter.name),
                                count, type.name, type.multiple));
  return {};
}

// "rgb reflectance"
Result<std::pair<std::string, std::string>> split(const Token& token, const Location& where) {
  const std::vector<std::string_view> words = text::tokens(token.text);
  if (words.size() != 2)
    return error_at(where,
                    fmt::format("{} is not the type and name of a parameter", text::quote(token.text)));
  return std::pair(std::string(words[0]), std::string(words[1]));
}

Error several(const Parameter& parameter, std::size_t wanted) {
  return error_at(parameter.where, fmt::format("parameter {} needs {} value{}", text::quote(parameter.name),
                                               wanted, wanted == 1 ? "" : "s"));
}

}  // namespace

Result<ParameterList> ParameterList::read(Tokens& tokens) {
  ParameterList list;
  constexpr std::size_t few = 16;  // names among which a search is quick
  std::unordered_map<std::string_view, std::size_t> places;
  while (true) {
    CANDELA_ASSIGN(const std::optional<Token> token, tokens.next());
    if (!token) return list;
    if (!token->quoted) {
      tokens.unget(*token);
      return list;
    }
    auto made = std::make_shared<Parameter>();
    Parameter& parameter = *made;
    parameter.where = tokens.where(*token);
    parameter.charge = Charge(tokens.budget());
    constexpr std::size_t blocks = 64, place = 64;  // the allocator's, and that in `places`
    if (!parameter.charge.take(sizeof(Parameter) + 2 * sizeof(Entry) + blocks + place + token->text.size() +
                               heap_bytes(parameter.where)))
      return too_much(tokens, parameter.where);
    CANDELA_ASSIGN(auto words, split(*token, parameter.where));
    std::tie(parameter.type, parameter.name) = std::move(words);
    const Type* type = find_type(parameter.type);
    if (type == nullptr) return unknown_type(parameter.where, parameter.type);
    CANDELA_TRY(read_values(tokens, parameter, *type));
    std::size_t same = 0;
    if (list.all_.size() < few) {
      while (same < list.all_.size() && list.all_[same].parameter->name != parameter.name) ++same;
    } else {
      if (places.empty())
        for (std::size_t i = 0; i < list.all_.size(); ++i) places.emplace(list.all_[i].parameter->name, i);
      const auto known = places.find(parameter.name);
      same = known == places.end() ? list.all_.size() : known->second;
      // The key is the name of the parameter that stays.
      if (known != places.end()) places.erase(known);
      places.emplace(parameter.name, same);
    }
    if (same == list.all_.size()) {
      list.all_.push_back({std::move(made)});
      continue;
    }
    if (list.replaced_.size() < max_replaced)
      list.replaced_.push_back(
          {parameter.where,
           fmt::format("parameter {} is given twice: the last value counts", text::quote(parameter.name))});
    list.all_[same].parameter = std::move(made);
  }
}

// ---- shared parameters ----

struct SharedParameters::Node {
  std::shared_ptr<const Parameter> parameter;
  NodePtr left, right;  // of smaller and of larger names
  int height = 1;
  Charge charge;
};

int SharedParameters::height(const NodePtr& node) {
  return node == nullptr ? 0 : node->height;
}

// `fits` becomes false beyond the budget; the tree is of no use then.
SharedParameters::NodePtr SharedParameters::join(std::shared_ptr<const Parameter> parameter, NodePtr left,
                                                 NodePtr right, ReadingBudget& budget, bool& fits) {
  auto node = std::make_shared<Node>();
  node->charge = Charge(budget);
  constexpr std::size_t block = 32;
  fits = node->charge.take(sizeof(Node) + block) && fits;
  node->parameter = std::move(parameter);
  node->height = 1 + std::max(height(left), height(right));
  node->left = std::move(left);
  node->right = std::move(right);
  return node;
}

// Heights differ by 2 at most: an AVL tree.
SharedParameters::NodePtr SharedParameters::balance(std::shared_ptr<const Parameter> parameter, NodePtr left,
                                                    NodePtr right, ReadingBudget& budget, bool& fits) {
  const auto joined = [&](std::shared_ptr<const Parameter> p, NodePtr l, NodePtr r) {
    return join(std::move(p), std::move(l), std::move(r), budget, fits);
  };
  if (height(left) > height(right) + 1) {
    if (height(left->left) >= height(left->right))
      return joined(left->parameter, left->left, joined(std::move(parameter), left->right, std::move(right)));
    const NodePtr& middle = left->right;
    return joined(middle->parameter, joined(left->parameter, left->left, middle->left),
                  joined(std::move(parameter), middle->right, std::move(right)));
  }
  if (height(right) > height(left) + 1) {
    if (height(right->right) >= height(right->left))
      return joined(right->parameter, joined(std::move(parameter), std::move(left), right->left),
                    right->right);
    const NodePtr& middle = right->left;
    return joined(middle->parameter, joined(std::move(parameter), std::move(left), middle->left),
                  joined(right->parameter, middle->right, right->right));
  }
  return joined(std::move(parameter), std::move(left), std::move(right));
}

SharedParameters::NodePtr SharedParameters::insert(const NodePtr& node,
                                                   std::shared_ptr<const Parameter> parameter,
                                                   ReadingBudget& budget, bool& fits) {
  if (node == nullptr) return join(std::move(parameter), nullptr, nullptr, budget, fits);
  const int order = parameter->name.compare(node->parameter->name);
  if (order == 0) return join(std::move(parameter), node->left, node->right, budget, fits);
  if (order < 0)
    return balance(node->parameter, insert(node->left, std::move(parameter), budget, fits), node->right,
                   budget, fits);
  return balance(node->parameter, node->left, insert(node->right, std::move(parameter), budget, fits), budget,
                 fits);
}

Result<void> SharedParameters::add(std::shared_ptr<const Parameter> parameter, ReadingBudget& budget) {
  const Location& where = parameter->where;
  const bool is_new = find(parameter->name) == nullptr;
  bool fits = true;
  NodePtr root = insert(root_, parameter, budget, fits);
  if (!fits) return budget.refusal(where, "values of Attribute", sizeof(Node));
  root_ = std::move(root);
  if (is_new) ++size_;
  return {};
}

const std::shared_ptr<const Parameter>* SharedParameters::find(std::string_view name) const {
  const Node* node = root_.get();
  while (node != nullptr) {
    const int order = name.compare(node->parameter->name);
    if (order == 0) return &node->parameter;
    node = order < 0 ? node->left.get() : node->right.get();
  }
  return nullptr;
}

// ---- access ----

const Parameter* ParameterList::take(std::string_view name,
                                     std::initializer_list<std::string_view> of_types) {
  if (std::find(asked_.begin(), asked_.end(), name) == asked_.end()) asked_.emplace_back(name);
  const auto fits = [&](const Parameter& parameter) {
    return std::find(of_types.begin(), of_types.end(), parameter.type) != of_types.end();
  };
  for (Entry& entry : all_) {
    if (entry.parameter->name != name) continue;
    if (!fits(*entry.parameter)) return nullptr;
    entry.used = true;
    return entry.parameter.get();
  }
  const auto* shared = defaults_.find(name);
  return shared != nullptr && fits(**shared) ? shared->get() : nullptr;
}

Result<std::optional<double>> ParameterList::optional_number(std::string_view name) {
  const Parameter* parameter = take(name, {"float", "integer"});
  if (parameter == nullptr) return std::optional<double>();
  if (parameter->numbers.size() != 1) return several(*parameter, 1);
  return std::optional<double>(parameter->numbers[0]);
}

Result<double> ParameterList::number(std::string_view name, double otherwise) {
  CANDELA_ASSIGN(const std::optional<double> given, optional_number(name));
  return given.value_or(otherwise);
}

Result<std::int64_t> ParameterList::integer(std::string_view name, std::int64_t otherwise) {
  const Parameter* parameter = take(name, {"integer"});
  if (parameter == nullptr) return otherwise;
  if (parameter->numbers.size() != 1) return several(*parameter, 1);
  if (!(std::abs(parameter->numbers[0]) < 1e15))
    return error_at(parameter->where, fmt::format("parameter {} is too large", text::quote(name)));
  return static_cast<std::int64_t>(parameter->numbers[0]);
}

Result<bool> ParameterList::flag(std::string_view name, bool otherwise) {
  const Parameter* parameter = take(name, {"bool"});
  if (parameter == nullptr) return otherwise;
  if (parameter->flags.size() != 1) return several(*parameter, 1);
  return static_cast<bool>(parameter->flags[0]);
}

Result<std::string> ParameterList::text(std::string_view name, std::string_view otherwise) {
  const Parameter* parameter = take(name, {"string"});
  if (parameter == nullptr) return std::string(otherwise);
  if (parameter->strings.size() != 1) return several(*parameter, 1);
  return parameter->strings[0];
}

Result<Vec3> ParameterList::point(std::string_view name, const Vec3& otherwise) {
  const Parameter* parameter = take(name, {"point3", "vector3"});
  if (parameter == nullptr) return otherwise;
  const std::vector<double>& n = parameter->numbers;
  if (n.size() != 3) return several(*parameter, 3);
  return Vec3{n[0], n[1], n[2]};
}

void ParameterList::ignore(std::initializer_list<std::string_view> names) {
  for (const std::string_view name : names) {
    asked_.emplace_back(name);
    for (Entry& entry : all_) entry.used |= entry.parameter->name == name;
  }
}

std::optional<Error> ParameterList::first_unused(std::string_view of) {
  for (; next_unused_ < all_.size(); ++next_unused_) {
    if (all_[next_unused_].used) continue;
    const Parameter& parameter = *all_[next_unused_++].parameter;
    const std::vector<std::string_view> known(asked_.begin(), asked_.end());
    if (std::find(known.begin(), known.end(), parameter.name) != known.end())
      return error_at(parameter.where,
                      fmt::format("parameter {} of {} has a type that it cannot have: {}",
                                  text::quote(parameter.name), of, text::quote(parameter.type)));
    const std::string_view nearest = nearest_name(parameter.name, known);
    return error_at(parameter.where, fmt::format("{} has no parameter {}", of, text::quote(parameter.name)))
        .with_mend(!nearest.empty() ? text::did_you_mean(nearest)
                   : known.empty()  ? "it has none"
                                    : fmt::format("it has {}", text::quoted_list(known)));
  }
  return std::nullopt;
}

Result<void> ParameterList::add_to(SharedParameters& defaults, ReadingBudget& budget) const {
  for (const Entry& entry : all_) CANDELA_TRY(defaults.add(entry.parameter, budget));
  return {};
}

bool ParameterList::is_only(std::initializer_list<std::string_view> names) const {
  std::size_t shared = 0;
  for (const std::string_view name : names) shared += defaults_.find(name) != nullptr ? 1 : 0;
  return shared == defaults_.size() && std::all_of(all_.begin(), all_.end(), [&](const Entry& entry) {
           return std::find(names.begin(), names.end(), entry.parameter->name) != names.end();
         });
}

const Parameter* ParameterList::given_outside(const std::string& file,
                                              std::initializer_list<std::string_view> names) const {
  for (const auto& [parameter, used] : all_)
    if (parameter->where.file != file &&
        std::find(names.begin(), names.end(), parameter->name) != names.end())
      return parameter.get();
  if (defaults_.empty()) return nullptr;
  for (const std::string_view name : names) {
    const auto* shared = defaults_.find(name);
    if (shared != nullptr && (*shared)->where.file != file && !has_own(name)) return shared->get();
  }
  return nullptr;
}

void ParameterList::forget_long_lists() {
  constexpr std::size_t few = 16;
  for (Entry& entry : all_) {
    std::vector<double>& numbers = entry.parameter->numbers;
    if (numbers.size() <= few) continue;
    entry.parameter->charge.give_back(numbers.capacity() * sizeof(double));
    std::vector<double>().swap(numbers);
  }
}

bool ParameterList::has_own(std::string_view name) const {
  return std::any_of(all_.begin(), all_.end(), [&](const Entry& e) { return e.parameter->name == name; });
}

bool ParameterList::has(std::string_view name) const {
  return has_own(name) || defaults_.find(name) != nullptr;
}

}  // namespace candela::description::pbrt
