// The frame in which a vertex measures its half vector: the smallest rotation that takes a fixed pole to the
// normal, and how fast it spins in its plane when the normal turns [half-vector note, section 3]. It is one
// function of the normal, singular at n = -P alone. The spin belongs into derivatives of half vectors: they
// are wrong without it wherever the half vector is not the normal.
#pragma once

#include "worker/core/vec.h"

namespace candela::transport::manifold {

// A generic direction, so that no wall of a scene has the singular normal; and the axes that it turns.
inline constexpr Vec3d kPole{2.0 / 7, 3.0 / 7, 6.0 / 7};
inline constexpr Vec3d kPoleS{6.0 / 7, 2.0 / 7, -3.0 / 7};
inline constexpr Vec3d kPoleT{-3.0 / 7, 6.0 / 7, -2.0 / 7};

struct PoleFrame {
  Vec3d s, t;
};

// False: the frame is singular at n, and a path with such a vertex is rejected.
constexpr bool has_pole_frame(Vec3d n) {
  return 1 + dot(n, kPole) >= 1e-6;
}

// n: unit.
constexpr PoleFrame pole_frame(Vec3d n) {
  const Vec3d q = (n + kPole) / (1 + dot(n, kPole));
  return {kPoleS - q * dot(n, kPoleS), kPoleT - q * dot(n, kPoleT)};
}

// t . ds, for a turn of the normal by dn.
constexpr double spin(Vec3d n, Vec3d dn) {
  return -dot(kPole, cross(n, dn)) / (1 + dot(n, kPole));
}

}  // namespace candela::transport::manifold
