// A scene as its XML says it, before anything is built: objects with typed properties, in Mitsuba 3 spelling
// (the 0.6 spelling is translated on the way in). `default`, `include`, `$parameters` and `ref` are resolved.
// Every object and property knows where it was written.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/base/result.h"

namespace candela::description {

struct Location {
  std::string file;  // as the bundle names it
  int line = 0;      // 1-based
};

using Vec3 = std::array<double, 3>;
using Mat4 = std::array<double, 16>;  // row-major; acts on column vectors

struct Rgb {
  Vec3 value{};  // linear Rec.709, whatever way it was written (rgb, srgb hex, spectrum, blackbody)
};

enum class PropertyType { boolean, integer, number, string, point, vector, rgb, transform };
std::string_view name(PropertyType type);

struct Property {
  std::string name;  // 3.x spelling
  PropertyType type{};
  std::variant<bool, std::int64_t, double, std::string, Vec3, Rgb, Mat4> value;  // point and vector: Vec3
  Location where;
};

struct Object;
using ObjectPtr = std::shared_ptr<const Object>;

struct Child {
  std::string slot;  // the name attribute, e.g. "reflectance"; empty where there is none
  ObjectPtr object;  // shared by all who refer to it
};

struct Object {
  std::string category;  // "scene", "integrator", "sensor", "sampler", "film", "rfilter", "bsdf", "shape",
                         // "emitter", "texture", ...
  std::string plugin;    // 3.x name, e.g. "roughconductor"; empty for the scene
  std::string id;        // may be empty
  Location where;
  std::vector<Property> properties;  // in written order, unique names
  std::vector<Child> children;       // in written order

  const Property* find(std::string_view property_name) const;  // nullptr if absent

  // Typed access with the documented default. The vocabulary has checked names and types before an Object
  // reaches anyone, so a present property of another type is our own mistake (assert).
  bool get_bool(std::string_view property_name, bool otherwise) const;
  std::int64_t get_integer(std::string_view property_name, std::int64_t otherwise) const;
  double get_number(std::string_view property_name, double otherwise) const;  // accepts an integer property
  std::string get_string(std::string_view property_name, std::string_view otherwise) const;
  Vec3 get_vec3(std::string_view property_name, Vec3 otherwise) const;  // point or vector
  Mat4 get_transform(std::string_view property_name) const;             // identity where absent
  std::optional<Rgb> get_rgb(std::string_view property_name) const;     // also from a number or integer: gray
  const Child* find_child(std::string_view slot) const;                 // by slot name
  std::vector<ObjectPtr> children_of(std::string_view category) const;
};

class ReadingBudget;

// Source of files: the submitting client's disk, or a bundle in a worker's cache. Keys are paths
// relative to the scene file's folder, lexically normalized ("../textures/a.png" stays possible: it is only a
// key).
class FileSource {
 public:
  virtual ~FileSource() = default;
  struct Bytes {
    std::shared_ptr<const void> owner;  // keeps `view` alive
    std::string_view view;
  };
  virtual Result<Bytes> open(
      const std::string& key) const = 0;  // error names the key and, at the client, the file
  // The first bytes of a file, at least `count` if it has so many. Sources that need not read the rest do
  // not.
  virtual Result<Bytes> start(const std::string& key, std::size_t /*count*/) const { return open(key); }
  // Fails if the file is not there or cannot be opened. Sources that can tell without reading it do so.
  virtual Result<void> find(const std::string& key) const {
    if (auto opened = open(key); !opened.ok()) return std::move(opened).error();
    return {};
  }
  // The memory that what is read from these files may take (reading_budget.h); without a limit if nobody
  // says.
  virtual ReadingBudget& budget() const;
};

// Notes for a reader of the scene that are no errors: values clamped, words of an old file read as
// something else.
struct Note {
  Location where;
  std::string text;
};

struct SceneDescription {
  ObjectPtr scene;  // category "scene"; children: integrator, sensor, shapes, emitters, bsdfs, ...
  std::vector<std::string>
      files;  // keys of all files read or referred to (XML, meshes, textures, spectra), sorted, unique
  std::vector<Note> notes = {};  // in the order they were met
  std::string aovs = {};         // layers that the scene asks for (scene_aovs.h); empty: none
  std::string layers = {};       // of light path expressions (common/letters/request.h); empty: none
};

// Parses and validates: unknown categories, plugins and properties (of old files see reading.h) are errors
// naming place and nearest known name; so are missing files, include cycles (and deeper than 64), unresolved
// $parameters and refs, parameters given but not used by the scene, values that do not parse, numbers that
// are not finite, singular transforms.
//
// The result is canonical: the value of a property that names a file is the file's key (open it
// with `files`); strings of a closed set are lower case; int_ior and ext_ior are numbers; a to_uv transform
// acts on (u, v, 0, 1). Files are looked for in the scene's <path> folders (the last one first), in the main
// scene file's folder, and in the folder of the included XML file that names them. Integrators that Mitsuba
// has and Candela lacks are kept with unchecked properties, for the command line may choose another;
// find_plugin() says which they are.
Result<SceneDescription> parse_scene(const FileSource& files, const std::string& main_key,
                                     const std::map<std::string, std::string>& parameters);

}  // namespace candela::description
