// pbrt's materials as bsdfs.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/description/pbrt/context.h"
#include "common/description/pbrt/textures.h"

namespace candela::description::pbrt {

struct Surface {
  ObjectPtr bsdf;
  ObjectPtr interior = nullptr;  // a medium that belongs to the material (subsurface); may be null
  std::uint64_t materials = 1;   // that it is made of; one that is named twice counts twice
};

// A material by name, or by the index of a Material directive.
struct MaterialName {
  std::string name;
  std::size_t index = 0;  // if the name is empty
  Location where;
};

class Materials {
 public:
  // `scene`: the place of the material of a scene that names none.
  Materials(Context& context, Textures& textures, const Location& scene);

  // MakeNamedMaterial. Material gives its index; index 0 is the material of a scene that names none.
  Result<void> define(const std::string& name, ParameterList parameters, ColorSpace space,
                      const Location& where);
  Result<std::size_t> add(const std::string& type, ParameterList parameters, ColorSpace space,
                          const Location& where);

  // Reads the material when it is used first.
  Result<Surface> surface(const MaterialName& name);

 private:
  struct Definition {
    std::string type;
    ParameterList parameters;
    ColorSpace space;
    Location where;
    bool open = false;  // being read: a mix that holds itself
    std::optional<Surface> surface;
  };
  struct Roughness {
    Value u, v;
    bool smooth = false;
  };
  // The index of refraction of a metal.
  struct Metal {
    Value eta, k;
    std::optional<Value> reflectance;  // a texture in place of the two
  };

  Result<void> check_type(const std::string& type, const Location& where);
  Result<Surface> read(Definition& definition);
  Result<Surface> diffuse(Definition& definition);
  Result<Surface> coated_diffuse(Definition& definition);
  Result<Surface> conductor(Definition& definition);
  Result<Surface> coated_conductor(Definition& definition);
  Result<Surface> dielectric(Definition& definition);
  Result<Surface> thin_dielectric(Definition& definition);
  Result<Surface> diffuse_transmission(Definition& definition);
  Result<Surface> mix(Definition& definition);
  Result<Surface> subsurface(Definition& definition);
  Result<Surface> hair(Definition& definition);
  Result<Vec3> hair_absorption(Definition& definition);
  Result<Surface> measured(Definition& definition);
  Result<Surface> stand_in(Definition& definition, const Error& error);

  // `otherwise`: the index of refraction if none is given.
  Result<ObjectPtr> coat(Definition& definition, const Value& reflectance, const Roughness& roughness,
                         double otherwise = 1.5);
  Result<ObjectPtr> glass(Definition& definition);
  Result<Metal> metal(Definition& definition, const std::string& prefix);
  Result<ObjectPtr> metal_bsdf(const Definition& definition, const Metal& metal, const Roughness& roughness,
                               double outside);
  // Gives a rough bsdf GGX microfacets of that roughness.
  static void set_microfacets(Object& bsdf, const Roughness& rough);
  Result<Roughness> roughness(Definition& definition, const std::string& prefix);
  // Shading normals from a picture or a displacement.
  Result<ObjectPtr> with_maps(Definition& definition, ObjectPtr bsdf);
  // The bsdf seen from both sides, with its maps: they turn the surface, whichever side is seen.
  Result<Surface> opaque(Definition& definition, ObjectPtr bsdf);

  Context& context_;
  Textures& textures_;
  std::map<std::string, Definition, std::less<>> named_;
  std::vector<Definition> numbered_;
  int depth_ = 0;  // of materials being read
};

}  // namespace candela::description::pbrt
