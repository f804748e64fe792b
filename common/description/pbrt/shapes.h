// pbrt's shapes: spheres, disks and cylinders as such where they are whole and round, everything else as
// triangles.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "common/description/pbrt/context.h"
#include "common/description/pbrt/materials.h"
#include "common/description/pbrt/media.h"
#include "common/description/pbrt/textures.h"

namespace candela::description::pbrt {

// A Shape directive with the state it was met in.
struct ShapeEntity {
  std::string type;
  ParameterList parameters;
  Location where;
  std::size_t offset = 0;  // of the word Shape in its file
  Mat4 to_world{};
  bool reverse_orientation = false;
  bool has_shared_values = false;                      // parameters of an Attribute directive are among them
  std::shared_ptr<const MaterialName> material;        // null: none is named
  std::shared_ptr<const std::string> inside, outside;  // media; null: none
  ObjectPtr emitter;                                   // null: it does not glow
  std::int64_t curve_count = 1;  // of directives that follow each other, if it is a curve

  // True if a directive of the same state may be read together with this one: both are curves that differ in
  // nothing but their geometry.
  bool joins(const ShapeEntity& other) const;
};

class Shapes {
 public:
  Shapes(Context& context, Textures& textures, Materials& materials, const Media& media)
      : context_(context), textures_(textures), materials_(materials), media_(media) {}

  // The shape with its bsdf, media and emitter; null if it is left out.
  Result<ObjectPtr> build(ShapeEntity& entity);

 private:
  Result<std::shared_ptr<Object>> geometry(ShapeEntity& entity);
  Result<std::shared_ptr<Object>> sphere(ShapeEntity& entity);
  Result<std::shared_ptr<Object>> disk(ShapeEntity& entity);
  Result<std::shared_ptr<Object>> cylinder(ShapeEntity& entity);
  Result<std::shared_ptr<Object>> curve(ShapeEntity& entity);
  Result<std::shared_ptr<Object>> ply(ShapeEntity& entity);
  Result<std::shared_ptr<Object>> part_of_quadric(ShapeEntity& entity);
  // Decides the front of triangles: those of a mesh, which a mirror does not turn around, or a quadric.
  enum class Front { of_mesh, of_quadric };
  // The triangles that the loader makes of the directive. `flat`: without shading normals.
  Result<std::shared_ptr<Object>> triangles(ShapeEntity& entity, bool flat, Front front);
  Result<ObjectPtr> masked(ShapeEntity& entity, ObjectPtr bsdf);
  Result<void> add_media(const ShapeEntity& entity, Object& shape, const ObjectPtr& interior);

  Context& context_;
  Textures& textures_;
  Materials& materials_;
  const Media& media_;
  std::map<std::pair<const Object*, std::pair<const Object*, double>>, ObjectPtr> masks_;
};

}  // namespace candela::description::pbrt
