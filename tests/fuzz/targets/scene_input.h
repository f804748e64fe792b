// Shared by the targets of scene readers: the files of a scene in one input, and the promises of a reading.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "common/description/object.h"
#include "common/description/reading.h"
#include "common/description/reading_budget.h"

namespace candela::fuzz {

class Files final : public description::FileSource {
 public:
  std::map<std::string, std::string, std::less<>> files;

  Result<Bytes> open(const std::string& key) const override {
    const auto found = files.find(key);
    if (found != files.end()) return Bytes{nullptr, found->second};
    // Data files are there, and empty, so that a scene with textures and meshes is taken to its end.
    const std::string_view text = key;
    const bool described = text.ends_with(".xml") || text.ends_with(".pbrt") || text.ends_with(".spd");
    if (text.size() > 4 && !described) return Bytes{nullptr, {}};
    return input_error("no file '" + key + "'");
  }
};

// The input is the main file; a line "=== NAME" begins another file, for includes and spectra.
inline Files files_of(const std::uint8_t* data, std::size_t size, std::string main) {
  std::string_view rest(reinterpret_cast<const char*>(data), size);
  constexpr std::string_view mark = "\n=== ";
  Files files;
  std::string name = std::move(main);
  while (true) {
    const std::size_t end = rest.find(mark);
    files.files.emplace(name, rest.substr(0, end));
    if (end == std::string_view::npos) return files;
    rest.remove_prefix(end + mark.size());
    const std::size_t line = rest.find('\n');
    name = rest.substr(0, line);
    rest.remove_prefix(line == std::string_view::npos ? rest.size() : line + 1);
  }
}

// Reads the scene strictly and leniently; aborts where a reading breaks its promise.
inline void read_both_ways(const Files& files, const std::string& main) {
  // The lenient reading has notes besides.
  description::ReadingBudget budget(std::uint64_t{512} << 20), larger(std::uint64_t{1} << 30);
  const description::BudgetedFiles counted(files, budget), loosely_counted(files, larger);
  const auto parsed = description::parse_scene(counted, main, {});
  // An error is one line that names its place.
  if (!parsed.ok() && parsed.error().to_string().find('\n') != std::string::npos) std::abort();
  if (parsed.ok() && parsed->scene == nullptr) std::abort();
  // The lenient reading takes whatever the strict one takes.
  const auto loose =
      description::read_scene(loosely_counted, main, {}, {.integrator = "path", .lenient = true});
  if (parsed.ok() && !loose.ok()) std::abort();
}

}  // namespace candela::fuzz
