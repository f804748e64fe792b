#include "worker/scene/bsdfs/strict_normals.h"

#include "worker/scene/bsdfs/bsdf_build.h"

namespace candela::scene {
namespace {

// The direction lies on the same side of both planes.
bool agrees(const StrictNormalsClosure& s, Vec3 v) {
  return v.z * dot(v, s.ng) > 0;
}

}  // namespace

ClosureTraits StrictNormalsClosure::traits() const {
  return {.purely_delta = nested->purely_delta(),
          .has_delta = nested->has_delta_lobes(),
          .reads_lobe = nested->chooses_lobe(),
          .through = nested->scatters_through(),
          .even = nested->even()};
}

Spectrum eval_pdf(const StrictNormalsClosure& s, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf) {
  pdf = 0;
  if (!agrees(s, wo) || !agrees(s, wi)) return {};
  return s.nested->eval_pdf(wo, wi, mode, pdf);
}

Spectrum eval_diffuse(const StrictNormalsClosure& s, Vec3 wo, Vec3 wi, TransportMode mode,
                      float glossy_below) {
  if (!agrees(s, wo) || !agrees(s, wi)) return {};
  return s.nested->eval_diffuse(wo, wi, mode, glossy_below);
}

bool sample(const StrictNormalsClosure& s, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode,
            BsdfSample& out) {
  if (!s.nested->sample(wo, u_lobe, u, mode, out)) return false;
  return out.passthrough || (agrees(s, wo) && agrees(s, out.wi));
}

Spectrum passthrough(const StrictNormalsClosure& s, Vec3 wo) {
  return s.nested->passthrough(wo);
}

Result<void> StrictNormalsSurface::build(const description::Object& object, const BuildContext& /*context*/) {
  return located("strict normals are no bsdf plugin", object, "");
}

void StrictNormalsSurface::prepare(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, Closure& out) const {
  const Vec3 ng = hit.ng, ns = hit.shading.n;
  if (ng.x == ns.x && ng.y == ns.y && ng.z == ns.z) {  // a plane, or a shape that is round itself
    nested->prepare(hit, wo, arena, out);
    return;
  }
  Closure& inner = arena.make();
  nested->prepare(hit, wo, arena, inner);
  out.set(StrictNormalsClosure{&inner, hit.shading.to_local(ng)});
  out.black = inner.black;
}

BsdfFacts StrictNormalsSurface::facts() const {
  return nested->facts();
}

std::uint32_t StrictNormalsSurface::arena_parts() const {
  return 1 + nested->arena_parts();
}

}  // namespace candela::scene
