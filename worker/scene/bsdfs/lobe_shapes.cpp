#include "worker/scene/bsdfs/lobe_shapes.h"

#include <algorithm>
#include <cmath>

#include "worker/scene/bsdfs/kinds.h"

namespace candela::scene {
namespace {

using Shapes = std::vector<LobeShape>;

void reflect(float alpha, Shapes& out) {
  out.push_back({false, static_cast<double>(alpha), 1});
}
// eta: inside over outside.
void refract(float alpha, float eta, Vec3 wo, Shapes& out) {
  const auto inside = static_cast<double>(eta);
  out.push_back({true, static_cast<double>(alpha), wo.z > 0 ? inside : 1 / inside});
}

void add(const Closure& closure, Vec3 wo, Shapes& out);

void shapes(const ConductorClosure& /*p*/, Vec3 /*wo*/, Shapes& out) {
  reflect(0, out);
}
void shapes(const DielectricClosure& p, Vec3 wo, Shapes& out) {
  reflect(0, out);
  if (!p.transmittance.is_black()) refract(0, p.eta, wo, out);
}
void shapes(const ThinDielectricClosure& /*p*/, Vec3 /*wo*/, Shapes& out) {
  reflect(0, out);
}
void shapes(const NullClosure& /*p*/, Vec3 /*wo*/, Shapes& /*out*/) {}
void shapes(const RoughConductorClosure& p, Vec3 /*wo*/, Shapes& out) {
  reflect(std::min(p.alpha_u, p.alpha_v), out);
}
void shapes(const RoughDielectricClosure& p, Vec3 wo, Shapes& out) {
  const float alpha = std::min(p.alpha_u, p.alpha_v);
  reflect(alpha, out);
  if (!p.transmittance.is_black()) refract(alpha, p.eta, wo, out);
}
void shapes(const PlasticClosure& p, Vec3 /*wo*/, Shapes& out) {
  if (!p.specular.is_black()) reflect(0, out);
  if (!p.diffuse.is_black()) reflect(1, out);
}
void shapes(const RoughPlasticClosure& p, Vec3 /*wo*/, Shapes& out) {
  if (!p.specular.is_black()) reflect(p.alpha, out);
  if (!p.diffuse.is_black()) reflect(1, out);
}
// A lobe of exponent e is as wide as facets of roughness sqrt(2 / (e + 2)) [Walter 2007].
void shapes(const PhongClosure& p, Vec3 /*wo*/, Shapes& out) {
  if (!p.specular.is_black()) reflect(std::min(1.0f, std::sqrt(2 / (p.exponent + 2))), out);
  if (!p.diffuse.is_black()) reflect(1, out);
}
void shapes(const WardClosure& p, Vec3 /*wo*/, Shapes& out) {
  if (!p.specular.is_black()) reflect(std::min({1.0f, p.alpha_u, p.alpha_v}), out);
  if (!p.diffuse.is_black()) reflect(1, out);
}
void shapes(const PrincipledClosure& p, Vec3 wo, Shapes& out) {
  const float alpha = std::min(p.alpha_u, p.alpha_v);
  reflect(alpha, out);
  if (p.coat > 0) reflect(p.coat_alpha, out);
  if (p.diffuse > 0) reflect(1, out);
  if (p.transmission > 0) refract(alpha, p.eta, wo, out);
}
void shapes(const PrincipledThinClosure& p, Vec3 /*wo*/, Shapes& out) {
  if (p.specular > 0) {
    reflect(std::min(p.alpha_u, p.alpha_v), out);
    out.push_back({true, static_cast<double>(std::min(p.through_u, p.through_v)), 1});
  }
  if (p.specular < 1) {
    reflect(1, out);
    if (p.diffuse_through > 0) out.push_back({true, 1, 1});
  }
}
void shapes(const CoatingClosure& p, Vec3 wo, Shapes& out) {
  if (!p.specular.is_black()) reflect(0, out);
  add(*p.below, wo, out);
}
void shapes(const RoughCoatingClosure& p, Vec3 wo, Shapes& out) {
  if (!p.specular.is_black()) reflect(p.alpha, out);
  add(*p.below, wo, out);
}
void shapes(const BlendClosure& p, Vec3 wo, Shapes& out) {
  if (p.weight < 1) add(*p.first, wo, out);
  if (p.weight > 0) add(*p.second, wo, out);
}
void shapes(const PerturbedClosure& p, Vec3 wo, Shapes& out) {
  add(*p.nested, wo, out);
}
void shapes(const StrictNormalsClosure& p, Vec3 wo, Shapes& out) {
  add(*p.nested, wo, out);
}
void shapes(const EditedClosure& p, Vec3 wo, Shapes& out) {
  add(*p.nested, wo, out);
}

// It belongs to a walk; no scene has it.
void shapes(const PathEditedClosure& /*p*/, Vec3 /*wo*/, Shapes& /*out*/) {}

// A kind without a function here is diffuse, on both sides if it lets light through.
template <std::size_t kRow = 0>
void add_of_kind(const Closure& closure, Vec3 wo, Shapes& out) {
  if constexpr (kRow < kBsdfKinds) {
    using C = ClosureOfRow<kRow>;
    if constexpr (!std::is_void_v<C>) {
      if (closure.is<C>()) {
        if constexpr (requires { shapes(closure.get<C>(), wo, out); }) {
          shapes(closure.get<C>(), wo, out);
        } else {
          reflect(1, out);
          if (closure.scatters_through()) out.push_back({true, 1, 1});
        }
        return;
      }
    }
    add_of_kind<kRow + 1>(closure, wo, out);
  }
}

void add(const Closure& closure, Vec3 wo, Shapes& out) {
  if (closure.black) return;
  add_of_kind(closure, closure.flipped ? Vec3{wo.x, wo.y, -wo.z} : wo, out);
}

}  // namespace

std::vector<LobeShape> lobe_shapes(const Closure& closure, Vec3 wo) {
  Shapes out;
  add(closure, wo, out);
  return out;
}

}  // namespace candela::scene
