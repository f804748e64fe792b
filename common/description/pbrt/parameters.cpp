#include "common/description/pbrt/parameters.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

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

Result<void> add_value(Parameter& parameter, const Type& type, const Token& token, const Location& where) {
  const auto wrong = [&](std::string_view expected) {
    return error_at(where, fmt::format("{} is no {} (parameter {})", text::quote(token.text), expected,
                                       text::quote(parameter.name)));
  };
  if (type.kind == Kind::flags) {
    const std::optional<bool> flag = text::to_boolean(token.text);
    if (!flag) return wrong("true or false");
    parameter.flags.push_back(*flag);
  } else if (type.kind == Kind::strings || (type.kind == Kind::either && token.quoted)) {
    if (!token.quoted) return wrong("string in quotes");
    parameter.strings.emplace_back(token.text);
  } else {
    const std::optional<double> number = token.quoted ? std::nullopt : text::to_number(token.text);
    if (!number) return wrong("finite number");
    if (type.name == "integer" && *number != std::floor(*number)) return wrong("whole number");
    parameter.numbers.push_back(*number);
  }
  return {};
}

Result<void> read_values(Tokens& tokens, Parameter& parameter, const Type& type) {
  CANDELA_ASSIGN(std::optional<Token> token, tokens.next());
  const bool list = token && !token->quoted && token->text == "[";
  for (std::size_t i = 0;; ++i) {
    work_step(i);
    if (list) {
      CANDELA_ASSIGN(token, tokens.next());
    }
    if (!token)
      return error_at(tokens.here(), fmt::format("the file ends within the values of parameter {}",
                                                 text::quote(parameter.name)));
    if (list && !token->quoted && token->text == "]") break;
    CANDELA_TRY(add_value(parameter, type, *token, tokens.where(*token)));
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
  while (true) {
    CANDELA_ASSIGN(const std::optional<Token> token, tokens.next());
    if (!token) return list;
    if (!token->quoted) {
      tokens.unget(*token);
      return list;
    }
    Parameter parameter;
    parameter.where = tokens.where(*token);
    CANDELA_ASSIGN(auto words, split(*token, parameter.where));
    std::tie(parameter.type, parameter.name) = std::move(words);
    const Type* type = find_type(parameter.type);
    if (type == nullptr) return unknown_type(parameter.where, parameter.type);
    CANDELA_TRY(read_values(tokens, parameter, *type));
    const auto same = std::find_if(list.all_.begin(), list.all_.end(),
                                   [&](const Parameter& other) { return other.name == parameter.name; });
    if (same == list.all_.end()) {
      list.all_.push_back(std::move(parameter));
      continue;
    }
    list.replaced_.push_back(
        {parameter.where,
         fmt::format("parameter {} is given twice: the last value counts", text::quote(parameter.name))});
    *same = std::move(parameter);
  }
}

const Parameter* ParameterList::take(std::string_view name,
                                     std::initializer_list<std::string_view> of_types) {
  if (std::find(asked_.begin(), asked_.end(), name) == asked_.end()) asked_.emplace_back(name);
  for (Parameter& parameter : all_) {
    if (parameter.name != name ||
        std::find(of_types.begin(), of_types.end(), parameter.type) == of_types.end())
      continue;
    parameter.used = true;
    return &parameter;
  }
  return nullptr;
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
    for (Parameter& parameter : all_) parameter.used |= parameter.name == name;
  }
}

std::optional<Error> ParameterList::first_unused(std::string_view of) {
  for (Parameter& parameter : all_) {
    if (parameter.used) continue;
    parameter.used = true;
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

void ParameterList::add_defaults(const ParameterList& defaults) {
  for (const Parameter& parameter : defaults.all_)
    if (!has(parameter.name)) {
      all_.push_back(parameter);
      all_.back().used = true;  // it need not fit all that come after it
    }
}

void ParameterList::append(const ParameterList& more) {
  for (const Parameter& parameter : more.all_) {
    std::erase_if(all_, [&](const Parameter& old) { return old.name == parameter.name; });
    all_.push_back(parameter);
  }
}

bool ParameterList::is_only(std::initializer_list<std::string_view> names) const {
  return std::all_of(all_.begin(), all_.end(), [&](const Parameter& parameter) {
    return std::find(names.begin(), names.end(), parameter.name) != names.end();
  });
}

const Parameter* ParameterList::given_outside(const std::string& file,
                                              std::initializer_list<std::string_view> names) const {
  for (const Parameter& parameter : all_)
    if (parameter.where.file != file && std::find(names.begin(), names.end(), parameter.name) != names.end())
      return &parameter;
  return nullptr;
}

void ParameterList::forget_long_lists() {
  constexpr std::size_t few = 16;
  for (Parameter& parameter : all_)
    if (parameter.numbers.size() > few) std::vector<double>().swap(parameter.numbers);
}

bool ParameterList::has(std::string_view name) const {
  return std::any_of(all_.begin(), all_.end(), [&](const Parameter& p) { return p.name == name; });
}

}  // namespace candela::description::pbrt
