// Strictness of reading a scene file, and the list of what was passed over.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "common/description/object.h"

namespace candela::description {

struct Reading {
  // The integrator that runs in place of the scene's; empty: the scene's own. If it is given, nothing in an
  // <integrator> element of the scene is an error but a bad value of a parameter that the element's own
  // plugin has, and its properties are those that the given integrator knows, also of integrators nested in
  // it.
  std::string integrator = {};
  // Unknown parameters and elements are passed over, and the nearest plugin stands in for an unknown one
  // (lenient.h); they are no errors. What the strict reading accepts means the same.
  bool lenient = false;
};

struct ReadScene {
  SceneDescription description;
  // Notes on plugins, parameters and values that the reading passed over or replaced, in the order of the
  // file. The description's notes contain them too.
  std::vector<Note> passed_over;
};

// parse_scene() is this with the strict reading. In files before version 2 an unknown parameter of a known
// plugin is passed over whatever the reading is, as Mitsuba 0.6 does; but not one that 0.6 heeds.
Result<ReadScene> read_scene(const FileSource& files, const std::string& main_key,
                             const std::map<std::string, std::string>& parameters, const Reading& reading);

}  // namespace candela::description
