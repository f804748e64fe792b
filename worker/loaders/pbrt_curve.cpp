#include "worker/loaders/pbrt_curve.h"

#include <cmath>
#include <limits>
#include <utility>

#include "common/description/check.h"
#include "common/description/pbrt/parameters.h"

namespace candela::loaders {
namespace {

using description::error_at;
using description::Location;
using description::pbrt::Parameter;
using description::pbrt::ParameterList;
using description::pbrt::Tokens;

using Bezier = std::array<Vec3d, 4>;

Vec3d between(Vec3d a, Vec3d b, double t) {
  return a * (1 - t) + b * t;
}

Bezier raised(Vec3d a, Vec3d b, Vec3d c) {
  return {a, between(a, b, 2.0 / 3), between(b, c, 1.0 / 3), c};
}

// The same polynomial in the basis of uniform B-splines.
std::array<Vec3d, 4> to_bspline(const Bezier& b) {
  return {b[0] * 6 - b[1] * 7 + b[2] * 2, b[1] * 2 - b[2], b[2] * 2 - b[1], b[1] * 2 - b[2] * 7 + b[3] * 6};
}

Result<std::vector<Vec3d>> control_points(ParameterList& parameters, const Location& where) {
  const Parameter* parameter = parameters.take("P", {"point3"});
  if (parameter == nullptr)
    return error_at(where, "the curve has no control points: the parameter 'P' is missing");
  std::vector<Vec3d> points(parameter->numbers.size() / 3);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double* const p = &parameter->numbers[3 * i];
    points[i] = {p[0], p[1], p[2]};
    for (int k = 0; k < 3; ++k)
      if (!std::isfinite(static_cast<float>(p[k])))
        return error_at(parameter->where, "a number of parameter 'P' is too large");
  }
  return points;
}

Result<PieceList> curve(ParameterList& parameters, const Location& where, std::size_t max_pieces) {
  CANDELA_ASSIGN(const std::vector<Vec3d> p, control_points(parameters, where));
  CANDELA_ASSIGN(const std::int64_t degree, parameters.integer("degree", 3));
  CANDELA_ASSIGN(const std::string basis, parameters.text("basis", "bezier"));
  CANDELA_ASSIGN(const double width, parameters.number("width", 1));
  CANDELA_ASSIGN(const double width0, parameters.number("width0", width));
  CANDELA_ASSIGN(const double width1, parameters.number("width1", width));
  CANDELA_ASSIGN(const std::string type, parameters.text("type", "flat"));
  if (type != "flat" && type != "cylinder" && type != "ribbon")
    return error_at(where, "the type of a curve is 'flat', 'cylinder' or 'ribbon'");
  if (degree != 2 && degree != 3) return error_at(where, "the degree of a curve is 2 or 3");
  if (basis != "bezier" && basis != "bspline")
    return error_at(where, "the basis of a curve is 'bezier' or 'bspline'");
  const double most = std::numeric_limits<float>::max();
  if (!(width0 >= 0 && width1 >= 0 && width0 <= most && width1 <= most))
    return error_at(where, "the width of a curve is finite and not negative");
  const auto d = static_cast<std::size_t>(degree);
  const bool bezier = basis == "bezier";
  if (p.size() <= d || (bezier && (p.size() - 1) % d != 0))
    return error_at(where, "a " + basis + " curve of degree " + std::to_string(degree) + " cannot have " +
                               std::to_string(p.size()) + " control points");
  const std::size_t pieces = bezier ? (p.size() - 1) / d : p.size() - d;
  if (pieces > max_pieces)
    return error_at(
        where, "the curves that follow each other up to here have more pieces than a mesh of tubes can hold");
  PieceList result(pieces);
  for (std::size_t i = 0; i < pieces; ++i) {
    const Vec3d* const c = &p[bezier ? i * d : i];
    std::array<Vec3d, 4> points;
    if (!bezier && d == 3)
      points = {c[0], c[1], c[2], c[3]};
    else if (!bezier)
      points = to_bspline(raised(between(c[0], c[1], 0.5), c[1], between(c[1], c[2], 0.5)));
    else
      points = to_bspline(d == 3 ? Bezier{c[0], c[1], c[2], c[3]} : raised(c[0], c[1], c[2]));
    // B-splines of control values in arithmetic progression are linear.
    const double step = (width1 - width0) / static_cast<double>(pieces) / 2;
    const double first = width0 / 2 + step * static_cast<double>(i);
    for (std::size_t k = 0; k < 4; ++k)
      result[i][k] = {points[k], first + step * (static_cast<double>(k) - 1)};
  }
  return result;
}

}  // namespace

Result<std::vector<PieceList>> load_pbrt_curves(std::string_view bytes, const std::string& name,
                                                std::int64_t offset, int line, std::int64_t count,
                                                std::size_t max_pieces, description::ReadingBudget& budget) {
  const Location first{name, line};
  if (offset < 0 || static_cast<std::uint64_t>(offset) >= bytes.size())
    return error_at(first, "the offset of a shape lies outside of the file");
  Tokens tokens(name, bytes, static_cast<std::size_t>(offset), line, nullptr, budget);
  // Bytes of a piece and of a tube around it, while the shape is made.
  constexpr std::uint64_t kPieceBytes = sizeof(CubicPiece) + 4096;
  description::Charge charge(budget);
  std::vector<PieceList> result;
  for (std::int64_t i = 0; i < count; ++i) {
    CANDELA_ASSIGN(const auto word, tokens.next());
    const Location where = word ? tokens.where(*word) : tokens.here();
    CANDELA_ASSIGN(const auto type, tokens.next());
    if (!word || word->quoted || word->text != "Shape" || !type || !type->quoted || type->text != "curve")
      return error_at(where, "here is no directive of a shape 'curve'");
    CANDELA_ASSIGN(ParameterList parameters, ParameterList::read(tokens));
    CANDELA_ASSIGN(PieceList pieces, curve(parameters, where, max_pieces));
    max_pieces -= pieces.size();
    CANDELA_TRY(charge.add(pieces.size() * kPieceBytes, where, "pieces of curves"));
    result.push_back(std::move(pieces));
  }
  return result;
}

}  // namespace candela::loaders
