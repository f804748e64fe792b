// The scene as a chain's walk sees it.
#pragma once

#include <cstddef>

#include "worker/transport/manifold/chain.h"

namespace candela::transport::manifold {

class Surfaces {
 public:
  virtual ~Surfaces() = default;

  // The first surface that a ray from the vertex `from` through `towards` meets, as the place of inner vertex
  // i: `out` has that vertex as it is now, whose surface's material the new one must have, and gets its
  // place, normals and tangents. False: the ray meets nothing, or another material, or a normal without
  // derivatives. The same arguments give the same bits.
  virtual bool meet(std::size_t i, const ChainVertex& from, Vec3d towards, ChainVertex& out) const = 0;
};

}  // namespace candela::transport::manifold
