// A bsdf on surfaces whose shading normals differ from the geometric one, as the integrators' strict_normals
// has it in Mitsuba 0.6: directions that lie on different sides of the two planes exchange nothing, so that
// no light leaks through a surface by its shading normals. What passes straight on does not look at normals
// and stays. It is no plugin: the scene puts it around its bsdfs.
#pragma once

#include <array>
#include <memory>
#include <string_view>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/surface.h"
#include "worker/scene/hit.h"

namespace candela::scene {

class Bsdf;

struct StrictNormalsClosure {
  const Closure* nested;
  Vec3 ng;  // in the shading frame

  ClosureTraits traits() const;
};
Spectrum eval_pdf(const StrictNormalsClosure& s, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf);
Spectrum eval_diffuse(const StrictNormalsClosure& s, Vec3 wo, Vec3 wi, TransportMode mode,
                      float glossy_below);
bool sample(const StrictNormalsClosure& s, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode,
            BsdfSample& out);
Spectrum passthrough(const StrictNormalsClosure& s, Vec3 wo);

struct StrictNormalsSurface {
  using ClosureType = StrictNormalsClosure;
  static constexpr std::array<std::string_view, 0> kPlugins = {};

  std::unique_ptr<Bsdf> nested;

  Result<void> build(const description::Object& object, const BuildContext& context);  // never called
  void prepare(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, Closure& out) const;
  BsdfFacts facts() const;
  std::uint32_t arena_parts() const;
  template <class Visitor>
  void for_each_part(const Visitor& visit) const {
    visit(*nested);
  }
};

}  // namespace candela::scene
