#include "common/description/pbrt/context.h"

#include <fmt/format.h>

#include <utility>

#include "common/description/check.h"
#include "common/description/file_key.h"
#include "common/description/text.h"
#include "common/description/vocabulary.h"
#include "common/job/bundle.h"

namespace candela::description::pbrt {
namespace {

constexpr std::size_t max_told = 100'000;

void put(Object& object, std::string_view name, PropertyType type, decltype(Property::value) value) {
  object.properties.push_back({std::string(name), type, std::move(value), object.where});
}

}  // namespace

void Context::set_main_file(const std::string& key) {
  main_folder_ = folder_of_key(key);
  used_files_.insert(key);
}

Result<std::string> Context::find_file(const Location& where, std::string_view name) {
  std::optional<Error> first_error;
  for (const std::string& folder : {main_folder_, folder_of_key(where.file)}) {
    const std::string key = file_key(folder, name);
    if (name.empty() || !bundle::is_valid_key(key))
      return error_at(where, fmt::format("{} is not the name of a file", text::quote(name)));
    if (used_files_.contains(key)) return key;
    Result<void> found = files_.find(key);
    if (found.ok()) {
      used_files_.insert(key);
      return key;
    }
    if (!first_error) first_error = std::move(found).error();
  }
  Error error = error_at(where, fmt::format("file {}: {}", text::quote(name), first_error->message));
  error.kind = first_error->kind;
  return error;
}

// Drops the note if the budget has no memory for it; the next object then fails.
void Context::tell(std::vector<Note>& notes, Note note) const {
  if (notes.size() >= max_told) return;
  if (budget().take(2 * sizeof note + heap_bytes(note.text) + heap_bytes(note.where)))
    notes.push_back(std::move(note));
}

void Context::warn(const Location& where, std::string text) {
  tell(passed_over_, {where, std::move(text)});
}

void Context::differs(const Location& where, std::string text) {
  tell(notes_, {where, std::move(text)});
}

Result<void> Context::refuse(const Error& error, std::string_view instead) {
  if (!reading_.lenient)
    return error.mend.empty() ? Error(error).with_mend(fmt::format("with --lenient {}", instead)) : error;
  if (passed_over_.size() >= max_told) return {};
  const std::string mend = error.mend.empty() ? std::string() : fmt::format(" ({})", error.mend);
  tell(passed_over_, {{error.file, error.line}, fmt::format("{}: {}{}", error.message, instead, mend)});
  return {};
}

Result<void> Context::refuse_unused(ParameterList& parameters, std::string_view of) {
  while (const std::optional<Error> unused = parameters.first_unused(of)) CANDELA_TRY(refuse(*unused));
  return {};
}

Error Context::unknown(const Location& where, std::string_view what, std::string_view name,
                       std::span<const std::string_view> known) {
  const std::string_view nearest = nearest_name(name, known);
  std::string mend = text::did_you_mean(nearest);
  if (nearest.empty())
    mend = known.empty() ? "there is none"
                         : fmt::format("there is {}", text::quoted_list({known.begin(), known.end()}));
  return error_at(where, fmt::format("unknown {} {}", what, text::quote(name))).with_mend(std::move(mend));
}

Result<ObjectPtr> Context::finish(std::shared_ptr<Object> object) const {
  const PluginRule* rule = find_plugin(object->category, object->plugin);
  if (rule == nullptr)
    return internal_error(fmt::format("no rule for {}", describe(*object)))
        .at(object->where.file, object->where.line);
  CANDELA_TRY(check_properties(*object, *rule));
  std::vector<Location> where;
  where.reserve(object->children.size());
  for (const Child& child : object->children) where.push_back(child.object->where);
  CANDELA_TRY(check_children(*object, *rule, where));
  CANDELA_TRY(budget().charge(memory_of(*object), object->where, "the scene's objects"));
  return ObjectPtr(std::move(object));
}

Result<void> add_counted(Object& object, ObjectPtr child, ReadingBudget& budget) {
  CANDELA_TRY(make_room(object.children, budget, child->where, "the scene's objects"));
  add(object, "", std::move(child));
  return {};
}

std::shared_ptr<Object> make(std::string_view category, std::string_view plugin, const Location& where) {
  auto object = std::make_shared<Object>();
  object->category = std::string(category);
  object->plugin = std::string(plugin);
  object->where = where;
  return object;
}

void set(Object& object, std::string_view name, double value) {
  put(object, name, PropertyType::number, value);
}
void set(Object& object, std::string_view name, const Rgb& value) {
  put(object, name, PropertyType::rgb, value);
}
void set(Object& object, std::string_view name, const Mat4& value) {
  put(object, name, PropertyType::transform, value);
}
void set(Object& object, std::string_view name, const std::string& value) {
  put(object, name, PropertyType::string, value);
}
void set_point(Object& object, std::string_view name, const Vec3& value) {
  put(object, name, PropertyType::point, value);
}
void set_integer(Object& object, std::string_view name, std::int64_t value) {
  put(object, name, PropertyType::integer, value);
}
void set_flag(Object& object, std::string_view name, bool value) {
  put(object, name, PropertyType::boolean, value);
}

}  // namespace candela::description::pbrt
