// Faces that two bodies share, such as a liquid and its glass modeled up to the same surface: of two surfaces
// in one place a ray meets the first alone (ties.h), and what the other one bounds is never entered or left.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "worker/scene/shapes/geometry.h"

namespace candela::scene {

// Pairs of shapes of the scene itself, in order, that have some area in common in one plane, to rounding.
// Looked at are shapes with looked_at[shape]; at most `most` pairs are told. The work is bounded: beyond some
// millions of comparisons of two primitives no more pairs are looked for.
std::vector<std::pair<std::uint32_t, std::uint32_t>> find_shared_faces(const Geometry& geometry,
                                                                       const std::vector<bool>& looked_at,
                                                                       std::size_t most);

}  // namespace candela::scene
