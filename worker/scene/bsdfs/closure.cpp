// Closure's functions, which dispatch over the kinds by a table of functions made from the list of kinds.
// Diffuse surfaces, the most frequent and the cheapest, come before the table and are inline here.
#include <array>
#include <type_traits>
#include <utility>

#include "worker/scene/bsdfs/kinds.h"

namespace candela::scene {
namespace {

// The functions of a kind of closure C, as functions of a Closure that is one. Each is a jump.
template <class C>
struct KindFunctions {
  static Spectrum eval_pdf_of(const Closure& closure, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf) {
    if constexpr (requires { eval_pdf(closure.get<C>(), wo, wi, mode, pdf); })
      return eval_pdf(closure.get<C>(), wo, wi, mode, pdf);
    else
      return {};
  }
  static bool sample_of(const Closure& closure, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode,
                        BsdfSample& out) {
    return sample(closure.get<C>(), wo, u_lobe, u, mode, out);
  }
  static Spectrum eval_diffuse_of(const Closure& closure, Vec3 wo, Vec3 wi, TransportMode mode,
                                  float glossy_below) {
    if constexpr (requires { eval_diffuse(closure.get<C>(), wo, wi, mode, glossy_below); }) {
      return eval_diffuse(closure.get<C>(), wo, wi, mode, glossy_below);
    } else {
      float pdf = 0;
      return eval_pdf_of(closure, wo, wi, mode, pdf);
    }
  }
  static Spectrum passthrough_of(const Closure& closure, Vec3 wo) {
    if constexpr (requires { passthrough(closure.get<C>(), wo); })
      return passthrough(closure.get<C>(), wo);
    else
      return {};
  }
};

struct FunctionsOfKind {
  Spectrum (*eval_pdf)(const Closure&, Vec3, Vec3, TransportMode, float&) = nullptr;
  bool (*sample)(const Closure&, Vec3, float, Vec2, TransportMode, BsdfSample&) = nullptr;
  Spectrum (*passthrough)(const Closure&, Vec3) = nullptr;
  Spectrum (*eval_diffuse)(const Closure&, Vec3, Vec3, TransportMode, float) = nullptr;
};

template <class C>
constexpr FunctionsOfKind functions_of_kind() {
  if constexpr (std::is_void_v<C>)
    return {};  // the number of a row without a closure of its own is no closure's kind
  else
    return {&KindFunctions<C>::eval_pdf_of, &KindFunctions<C>::sample_of, &KindFunctions<C>::passthrough_of,
            &KindFunctions<C>::eval_diffuse_of};
}

// By Closure::kind().
constexpr std::array<FunctionsOfKind, kBsdfKinds> kFunctions =
    []<std::size_t... kRows>(std::index_sequence<kRows...>) {
  return std::array<FunctionsOfKind, kBsdfKinds>{functions_of_kind<ClosureOfRow<kRows>>()...};
}
(std::make_index_sequence<kBsdfKinds>());

}  // namespace

Spectrum Closure::eval_pdf(Vec3 wo, Vec3 wi, TransportMode mode, float& pdf) const {
  pdf = 0;
  if (black) return {};
  if (flipped) {
    wo.z = -wo.z;
    wi.z = -wi.z;
  }
  if (is<DiffuseClosure>()) return scene::eval_pdf(get<DiffuseClosure>(), wo, wi, mode, pdf);
  return kFunctions[kind_].eval_pdf(*this, wo, wi, mode, pdf);
}

Spectrum Closure::eval_diffuse(Vec3 wo, Vec3 wi, TransportMode mode, float glossy_below) const {
  if (black) return {};
  if (flipped) {
    wo.z = -wo.z;
    wi.z = -wi.z;
  }
  return kFunctions[kind_].eval_diffuse(*this, wo, wi, mode, glossy_below);
}

Spectrum Closure::passthrough(Vec3 wo) const {
  if (black) return {};
  if (flipped) wo.z = -wo.z;
  return kFunctions[kind_].passthrough(*this, wo);
}

Spectrum Closure::eval(Vec3 wo, Vec3 wi, TransportMode mode) const {
  float pdf = 0;
  return eval_pdf(wo, wi, mode, pdf);
}

float Closure::pdf_solid_angle(Vec3 wo, Vec3 wi, TransportMode mode) const {
  float pdf = 0;
  static_cast<void>(eval_pdf(wo, wi, mode, pdf));
  return pdf;
}

bool Closure::sample(Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out) const {
  out = {};
  if (black) return false;
  if (flipped) wo.z = -wo.z;
  const bool valid = is<DiffuseClosure>() ? scene::sample(get<DiffuseClosure>(), wo, u_lobe, u, mode, out)
                                          : kFunctions[kind_].sample(*this, wo, u_lobe, u, mode, out);
  if (valid && flipped) out.wi.z = -out.wi.z;
  return valid;
}

}  // namespace candela::scene
