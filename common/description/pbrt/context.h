// The tools of all parts of the pbrt reader: the scene's files, objects with checked parameters, and notes on
// differences.
#pragma once

#include <memory>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/description/pbrt/parameters.h"
#include "common/description/reading.h"
#include "common/description/unpacked_files.h"

namespace candela::description::pbrt {

class Context {
 public:
  Context(const UnpackedFiles& files, const Reading& reading) : files_(files), reading_(reading) {}

  const Reading& reading() const { return reading_; }
  ReadingBudget& budget() const { return files_.budget(); }

  // The key of a file that the scene names: pbrt looks in the folder of the main file alone; ours then looks
  // in the folder of the file that names it.
  Result<std::string> find_file(const Location& where, std::string_view name);
  // The text of a file of directives, at most `max_bytes` if it is packed.
  Result<FileSource::Bytes> open(const std::string& key, std::size_t max_bytes) const {
    return files_.open(key, max_bytes);
  }
  // The first bytes of a picture or mesh, at least `count` if it has so many.
  Result<FileSource::Bytes> start(const std::string& key, std::size_t count) const {
    return files_.start(key, count);
  }
  void set_main_file(const std::string& key);

  // The file says something that does not count; told by each command that reads the scene.
  void warn(const Location& where, std::string text);
  // The picture differs from pbrt's; told by `candela check`.
  void differs(const Location& where, std::string text);
  // Without --lenient the error; with it a warning, and the caller goes on with what stands in.
  Result<void> refuse(const Error& error, std::string_view instead = "it is passed over");
  // Parameters that nobody asked for. `of`: "material 'diffuse'".
  Result<void> refuse_unused(ParameterList& parameters, std::string_view of);
  // The error for a name that is not in the list: "unknown material 'difuse' (did you mean 'diffuse'?)".
  static Error unknown(const Location& where, std::string_view what, std::string_view name,
                       std::span<const std::string_view> known);

  // Checks parameters and children against the vocabulary, and counts the object's memory.
  Result<ObjectPtr> finish(std::shared_ptr<Object> object) const;

  std::set<std::string> take_files() { return std::move(used_files_); }
  std::vector<Note> take_notes() { return std::move(notes_); }
  std::vector<Note> take_passed_over() { return std::move(passed_over_); }

 private:
  void tell(std::vector<Note>& notes, Note note) const;

  const UnpackedFiles& files_;
  const Reading& reading_;
  std::string main_folder_;
  std::set<std::string> used_files_;
  std::vector<Note> notes_;
  std::vector<Note> passed_over_;
};

std::shared_ptr<Object> make(std::string_view category, std::string_view plugin, const Location& where);
void set(Object& object, std::string_view name, double value);
void set(Object& object, std::string_view name, const Rgb& value);
void set(Object& object, std::string_view name, const Mat4& value);
void set(Object& object, std::string_view name, const std::string& value);
void set_point(Object& object, std::string_view name, const Vec3& value);
void set_integer(Object& object, std::string_view name, std::int64_t value);
void set_flag(Object& object, std::string_view name, bool value);
// The last child of `object`, whose list of children counts.
Result<void> add_counted(Object& object, ObjectPtr child, ReadingBudget& budget);
inline void add(Object& object, std::string_view slot, ObjectPtr child) {
  object.children.push_back({std::string(slot), std::move(child)});
}

}  // namespace candela::description::pbrt
