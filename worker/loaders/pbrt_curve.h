// The curves of Shape directives in a file of a pbrt scene.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/description/reading_budget.h"
#include "worker/loaders/curves.h"

namespace candela::loaders {

// A cubic piece of a curve as four control points of a uniform B-spline.
using CubicPiece = std::array<ControlPoint, 4>;
// Pieces that follow each other: one ends where the next begins.
using PieceList = std::vector<CubicPiece>;

// Every piece becomes 20 triangles or more, and a mesh has at most 2^28.
constexpr std::size_t kMaxCubicPieces = (std::size_t{1} << 28) / 20;

// `count` directives that follow each other, one list for each. `offset` is where the word Shape of the first
// begins, in line `line`. Bezier curves and B-splines, of degree 2 or 3, become cubic pieces; the radius,
// half of pbrt's width, is linear in the curve's parameter. More pieces than `max_pieces` in all are an error
// at the directive that has them.
Result<std::vector<PieceList>> load_pbrt_curves(
    std::string_view bytes, const std::string& name, std::int64_t offset, int line, std::int64_t count,
    std::size_t max_pieces = kMaxCubicPieces,
    description::ReadingBudget& budget = description::ReadingBudget::unlimited());

}  // namespace candela::loaders
