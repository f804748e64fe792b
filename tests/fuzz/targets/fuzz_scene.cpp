// parse_scene on any bytes. The input is the main file; after a line "=== NAME" follows another file of that
// name, for includes and spectra. Files that scenes name and the input lacks are there, and empty.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <string>
#include <string_view>

#include "common/description/object.h"
#include "common/description/reading.h"

namespace {

using namespace candela;

class Files final : public description::FileSource {
 public:
  std::map<std::string, std::string, std::less<>> files;
  Result<Bytes> open(const std::string& key) const override {
    const auto found = files.find(key);
    if (found != files.end()) return Bytes{nullptr, found->second};
    // An unnamed rest, so that a scene with textures and meshes is taken to its end.
    if (key.size() > 4 && !key.ends_with(".xml") && !key.ends_with(".spd")) return Bytes{nullptr, {}};
    return input_error("no file '" + key + "'");
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string_view rest(reinterpret_cast<const char*>(data), size);
  constexpr std::string_view mark = "\n=== ";
  Files files;
  std::string name = "scene.xml";
  while (true) {
    const std::size_t end = rest.find(mark);
    files.files.emplace(name, rest.substr(0, end));
    if (end == std::string_view::npos) break;
    rest.remove_prefix(end + mark.size());
    const std::size_t line = rest.find('\n');
    name = rest.substr(0, line);
    rest.remove_prefix(line == std::string_view::npos ? rest.size() : line + 1);
  }
  const auto parsed = description::parse_scene(files, "scene.xml", {});
  // An error is one line that names its place.
  if (!parsed.ok() && parsed.error().to_string().find('\n') != std::string::npos) std::abort();
  if (parsed.ok() && parsed->scene == nullptr) std::abort();
  // The lenient reading takes whatever the strict one takes.
  const auto loose = description::read_scene(files, "scene.xml", {}, {.integrator = "path", .lenient = true});
  if (parsed.ok() && !loose.ok()) std::abort();
  return 0;
}
