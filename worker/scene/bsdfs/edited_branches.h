// Directions that edits turn at a vertex, and back; for the closures of edited bsdfs (edited.h,
// path_edited.h), and for edited lamps. All directions are local.
#pragma once

#include <array>
#include <cstdint>

#include "worker/scene/bsdfs/edited.h"

namespace candela::scene::edited {

inline constexpr std::size_t kMaxBranches = std::size_t{1} << SurfaceEdits::kMax;

// A direction that light along another one may have been meant for.
struct Branch {
  Vec3 w;
  double jacobian = 1;  // of solid angle: d omega(w) / d omega(the other)
  Spectrum factor = Spectrum(1);
  bool moved = false;
};
struct Branches {
  std::uint32_t count = 0;
  std::array<Branch, kMaxBranches> at;
  void add(const Branch& branch) { at[count++] = branch; }
};

// All directions that light along v may have been meant for, by the edits in `bits`: the last is undone
// first.
void undo(const EditedClosure& e, std::uint16_t bits, Vec3 v, Branches& out);
// Turns w, where light would go, to where the edits send it. False: it is lost.
bool apply(const EditedClosure& e, std::uint16_t bits, Vec3& w);
// Gamma of a branch of v.
double gamma(const EditedClosure& e, Vec3 v, const Branch& b);
// The factor of a branch of wo. Of light it is Gamma; of the eye what Gamma leaves after the correction for
// shading normals.
double factor_against(const EditedClosure& e, TransportMode mode, Vec3 wo, const Branch& b);
// The factor of a branch of wi, without its Jacobian.
double factor_with(const EditedClosure& e, TransportMode mode, Vec3 wi, const Branch& b);

}  // namespace candela::scene::edited
