// Scenes of pbrt's version 4: a second way to the description that scenes of Mitsuba's XML become.
//
// The directives are read one after the other into entities (shapes, lights, definitions of materials,
// textures and media), each with the state of its place. At the end they become objects of our vocabulary.
// docs/pbrt.md tells which.
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "common/description/reading.h"

namespace candela::description::pbrt {

// Told by the ending of the name: .pbrt or .pbrt.gz.
bool is_pbrt_file(std::string_view key);

// As read_scene(). A pbrt scene has no $parameters.
Result<ReadScene> read_pbrt_scene(const FileSource& files, const std::string& main_key,
                                  const std::map<std::string, std::string>& parameters,
                                  const Reading& reading);

}  // namespace candela::description::pbrt
