// The scene's <integrator> where another one runs.
#pragma once

#include <memory>
#include <pugixml.hpp>
#include <string>
#include <vector>

#include "common/description/object.h"
#include "common/description/parameters.h"
#include "common/description/scene_aovs.h"
#include "common/description/xml_document.h"

namespace candela::description {

struct OtherIntegrator {
  const XmlDocument& document;
  bool legacy;               // the element is of a file before version 2
  std::string_view runs;     // the name of the integrator that runs
  Parameters& parameters;    // those used in the element count as used
  std::vector<Note>& notes;  // if the scene's integrator is the one that runs: what of it is passed over
  SceneRequests& requests;   // get what an element asks for, unless something is there already

  // An object of the element's plugin, whatever it is called. Its properties are the parameters that the
  // integrator that runs knows and whose values it can have, from the element and the integrators nested in
  // it; the first value counts. A bad value of what the plugin itself has is an error. `depth` is the node's.
  Result<std::shared_ptr<Object>> read(const pugi::xml_node& node, int depth) const;

 private:
  std::string text_of(const pugi::xml_node& node, const char* attribute) const;
  Result<void> walk(const pugi::xml_node& node, std::string_view plugin, Object& into, int depth) const;
  Result<void> take(const pugi::xml_node& node, std::string_view plugin, Object& into) const;
};

}  // namespace candela::description
