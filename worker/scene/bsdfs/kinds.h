// The kinds of bsdfs, listed once. What a surface and a closure offer is in surface.h and bsdf.h.
//
// To add one: write bsdfs/<kind>.{h,cpp} (its closure with the maths, its surface), add its surface to the
// list below, and its parameters to the vocabulary (common/description/rules_bsdfs.cpp).
#pragma once

#include <cstddef>
#include <new>
#include <type_traits>
#include <variant>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/blend.h"
#include "worker/scene/bsdfs/coating.h"
#include "worker/scene/bsdfs/conductor.h"
#include "worker/scene/bsdfs/dielectric.h"
#include "worker/scene/bsdfs/difftrans.h"
#include "worker/scene/bsdfs/diffuse.h"
#include "worker/scene/bsdfs/edited.h"
#include "worker/scene/bsdfs/hk.h"
#include "worker/scene/bsdfs/mask.h"
#include "worker/scene/bsdfs/null.h"
#include "worker/scene/bsdfs/path_edited.h"
#include "worker/scene/bsdfs/perturbed.h"
#include "worker/scene/bsdfs/phase_closure.h"
#include "worker/scene/bsdfs/phong.h"
#include "worker/scene/bsdfs/plastic.h"
#include "worker/scene/bsdfs/principled.h"
#include "worker/scene/bsdfs/principled_thin.h"
#include "worker/scene/bsdfs/roughcoating.h"
#include "worker/scene/bsdfs/roughconductor.h"
#include "worker/scene/bsdfs/roughdielectric.h"
#include "worker/scene/bsdfs/roughdiffuse.h"
#include "worker/scene/bsdfs/roughplastic.h"
#include "worker/scene/bsdfs/strict_normals.h"
#include "worker/scene/bsdfs/thindielectric.h"
#include "worker/scene/bsdfs/twosided.h"
#include "worker/scene/bsdfs/ward.h"

namespace candela::scene {

using BsdfSurface =
    std::variant<DiffuseSurface, DielectricSurface, ConductorSurface, RoughConductorSurface, NullSurface,
                 PhongSurface, WardSurface, PrincipledSurface, RoughDielectricSurface, ThinDielectricSurface,
                 PlasticSurface, RoughPlasticSurface, TwoSidedSurface, BlendSurface, MaskSurface,
                 PerturbedSurface, RoughDiffuseSurface, DiffuseTransmitterSurface, LayerSurface,
                 CoatingSurface, RoughCoatingSurface, StrictNormalsSurface, PrincipledThinSurface,
                 EditedSurface, PathEditedSurface, PhaseSurface>;

inline constexpr std::size_t kBsdfKinds = std::variant_size_v<BsdfSurface>;

// The closure of a row of the list.
template <std::size_t kRow>
using ClosureOfRow = typename std::variant_alternative_t<kRow, BsdfSurface>::ClosureType;

// The number of a kind of closure: the first row that has it. kBsdfKinds: none.
template <class C, std::size_t kRow = 0>
consteval std::size_t closure_kind() {
  if constexpr (kRow == kBsdfKinds)
    return kBsdfKinds;
  else if constexpr (std::is_same_v<C, ClosureOfRow<kRow>>)
    return kRow;
  else
    return closure_kind<C, kRow + 1>();
}

template <class C>
void Closure::set(const C& closure) {
  static_assert(closure_kind<C>() < kBsdfKinds, "a closure is that of a surface in the list");
  static_assert(sizeof(C) <= kRoom && alignof(C) <= alignof(Closure) && std::is_trivially_copyable_v<C>);
  kind_ = static_cast<std::uint8_t>(closure_kind<C>());
  flipped = false;
  black = false;
  traits_ = closure.traits();
  new (room_) C(closure);
}

template <class C>
bool Closure::is() const {
  return kind_ == closure_kind<C>();
}

template <class C>
const C& Closure::get() const {
  return *std::launder(reinterpret_cast<const C*>(room_));
}

}  // namespace candela::scene
