// A Bsdf as the scene keeps it: a plain surface, or a composite of further Bsdfs. prepare() looks textures up
// at a hit, resolves two-sidedness and lays composites out in an arena; what it returns is sampled and
// evaluated without looking at the scene again.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"
#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/perturbation.h"
#include "worker/scene/bsdfs/surfaces.h"
#include "worker/scene/bsdfs/surfaces_dielectric.h"
#include "worker/scene/bsdfs/surfaces_phong.h"
#include "worker/scene/bsdfs/surfaces_plastic.h"
#include "worker/scene/bsdfs/surfaces_principled.h"
#include "worker/scene/hit.h"
#include "worker/scene/textures/texture.h"

namespace candela::scene {

class Bsdf {
 public:
  // From a description object of category "bsdf". Errors name file, line and property.
  // `coats`: tables that the bsdfs of a scene share as they share images.
  static Result<Bsdf> build(const description::Object& object, TextureStore& textures,
                            RoughTransmittances& coats);
  // A bsdf that stands alone.
  static Result<Bsdf> build(const description::Object& object, TextureStore& textures);
  // Mitsuba's default of a shape without a bsdf: one-sided diffuse, reflectance 0.5.
  static Bsdf default_diffuse();

  // wo: unit, in the hit's shading frame, towards where the walk came from. The closure is good for as long
  // as the arena is not cleared.
  void prepare(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, Closure& out) const;

  BsdfFacts facts() const;
  // The plugins it is made of, each once, parts before wholes, without twosided.
  void collect_plugins(std::vector<std::string>& names) const;

 private:
  // Both sides alike where there is no back.
  struct TwoSided {
    std::unique_ptr<Bsdf> front, back;
    const Bsdf& of(bool below) const { return below && back != nullptr ? *back : *front; }
  };
  struct Blend {
    std::unique_ptr<Bsdf> first, second;
    FloatTexture weight;  // of the second
  };
  struct Mask {
    std::unique_ptr<Bsdf> nested;
    FloatTexture opacity;
  };
  struct Perturbed {
    std::unique_ptr<Bsdf> nested;
    Perturbation map;
  };
  using Surface = std::variant<DiffuseSurface, DielectricSurface, ConductorSurface, RoughConductorSurface,
                               NullSurface, PhongSurface, WardSurface, PrincipledSurface,
                               RoughDielectricSurface, ThinDielectricSurface, PlasticSurface,
                               RoughPlasticSurface, TwoSided, Blend, Mask, Perturbed>;

  static Result<Bsdf> build_at_depth(const description::Object& object, TextureStore& textures,
                                     RoughTransmittances& coats, int depth);
  static Result<std::unique_ptr<Bsdf>> build_part(const description::Object& object, TextureStore& textures,
                                                  RoughTransmittances& coats, int depth);
  Result<void> build_two_sided(const description::Object& object, TextureStore& textures,
                               RoughTransmittances& coats, int depth);
  Result<void> build_blend(const description::Object& object, TextureStore& textures,
                           RoughTransmittances& coats, int depth);
  Result<void> build_mask(const description::Object& object, TextureStore& textures,
                          RoughTransmittances& coats, int depth);
  Result<void> build_perturbed(const description::Object& object, TextureStore& textures,
                               RoughTransmittances& coats, int depth);
  std::uint32_t arena_parts() const;  // closures that prepare() may make in the arena

  Surface surface_;
  std::string plugin_ = "diffuse";
};

}  // namespace candela::scene
