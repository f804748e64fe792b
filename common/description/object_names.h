// Names by which light path expressions know the objects of a scene (docs/layers.md).
//
// A shape has its id, the id of its shapegroup, and the id of its bsdf, through bsdfs that hold one other:
// `twosided` and its like. If it glows, it has the name of its lamp, too. An area light without an id is
// called as its shape. Other lamps without an id, and such media, are called by kind and number, "area.3", in
// the order of the file.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "common/description/object.h"

namespace candela::description {

class ObjectNamesOfScene {
 public:
  // The lamps and media of the scene, which is the object of SceneDescription::scene.
  explicit ObjectNamesOfScene(const Object& scene);

  // `group`: the shapegroup that holds the shape, or null. `part`: the bsdf of a part of an OBJ file that has
  // several, or null for the shape's own. Each name once.
  std::vector<std::string> of_shape(const Object& shape, const Object* group = nullptr,
                                    const Object* part = nullptr) const;
  // One name each; the arguments are objects of the scene, known by their addresses. An area light that
  // several shapes share is one lamp.
  const std::string& of_lamp(const Object& emitter) const { return lamps_.at(&emitter); }
  const std::string& of_medium(const Object& medium) const { return media_.at(&medium); }

  // All of them in the order of the file.
  const std::vector<const Object*>& lamps() const { return lamp_order_; }
  const std::vector<const Object*>& media() const { return medium_order_; }

 private:
  using Names = std::map<const Object*, std::string>;
  void visit(const Object& object);
  // Names those that have no name yet.
  void name_all(const std::vector<const Object*>& order, Names& names) const;

  Names lamps_, media_;
  std::vector<const Object*> lamp_order_, medium_order_;
  std::set<const Object*> groups_;  // visited
};

// A shape with its shapegroup and part, as of_shape() takes them.
struct MatteShape {
  const Object* shape = nullptr;
  const Object* group = nullptr;
  const Object* part = nullptr;
};
// Names of mattes, by shape. An object has the id of its shape, or of its shapegroup, or else kind and
// number, "sphere.3", in the order of the shapes. A material has the id of its bsdf, or else is called as its
// object. Objects of one name are one matte.
struct MatteNames {
  std::vector<std::string> objects, materials;
};
MatteNames matte_names(const std::vector<MatteShape>& shapes);

}  // namespace candela::description
