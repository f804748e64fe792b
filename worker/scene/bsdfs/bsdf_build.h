// A Bsdf as the scene keeps it: a plain surface, or a composite of further Bsdfs. prepare() looks textures up
// at a hit, resolves two-sidedness and lays composites out in an arena; the closure it makes is sampled and
// evaluated without looking at the scene again.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"
#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/kinds.h"
#include "worker/scene/bsdfs/rough_transmittance.h"
#include "worker/scene/bsdfs/surface.h"
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
  // A part of the composite whose context is given.
  static Result<std::unique_ptr<Bsdf>> build_part(const description::Object& object,
                                                  const BuildContext& composite);
  // Mitsuba's default of a shape without a bsdf: one-sided diffuse, reflectance 0.5.
  static Bsdf default_diffuse();
  // The bsdf as strict_normals has it (strict_normals.h).
  static Result<Bsdf> with_strict_normals(Bsdf bsdf);
  // bsdfs[nested] with edits (edited.h). `bsdfs` outlives it.
  static Result<Bsdf> with_edits(const std::vector<Bsdf>& bsdfs, std::uint32_t nested, SurfaceEdits edits);

  // wo: unit, in the hit's shading frame, towards where the walk came from. The closure is good for as long
  // as the arena is not cleared.
  void prepare(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, Closure& out) const;

  BsdfFacts facts() const;
  // The plugins it is made of, each once, parts before wholes, without twosided.
  void collect_plugins(std::vector<std::string>& names) const;
  std::uint32_t arena_parts() const;  // closures that prepare() may make in the arena

 private:
  static Result<Bsdf> build_in(const description::Object& object, const BuildContext& context);

  BsdfSurface surface_;
  std::string plugin_ = "diffuse";
};

}  // namespace candela::scene
