#include "worker/scene/shapes/tube.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "common/base/work_monitor.h"
#include "worker/core/math.h"

namespace candela::scene {
namespace {

// A place on a curve: its unit tangent, its radius, and how fast the radius grows along the curve.
struct Section {
  Vec3d p, tangent;
  double radius = 0, slope = 0;
};

constexpr std::size_t kMaxSides = 16, kMinSides = 5;
constexpr std::size_t kVertexBudget = 2'000'000;  // where many curves make sides scarce
constexpr double kTurn = 0.2;                     // radians that a segment's tangent turns between sections
constexpr int kMinSteps = 2, kMaxSteps = 16;

struct SplinePoint {
  Vec3d p, derivative;
  double radius = 0, radius_derivative = 0;
};

// The basis of uniform cubic B-splines.
SplinePoint spline_at(const loaders::ControlPoint* c, double t) {
  const double s = 1 - t;
  const double b[4] = {s * s * s / 6, (3 * t * t * t - 6 * t * t + 4) / 6,
                       (-3 * t * t * t + 3 * t * t + 3 * t + 1) / 6, t * t * t / 6};
  const double d[4] = {-s * s / 2, (3 * t * t - 4 * t) / 2, (-3 * t * t + 2 * t + 1) / 2, t * t / 2};
  SplinePoint out;
  for (int i = 0; i < 4; ++i) {
    out.p += c[i].p * b[i];
    out.derivative += c[i].p * d[i];
    out.radius += c[i].radius * b[i];
    out.radius_derivative += c[i].radius * d[i];
  }
  return out;
}

// About the angle between two directions, up to pi / 2 where they are opposite.
double turn(Vec3d a, Vec3d b) {
  const double l = length(a) * length(b);
  return l > 0 ? std::numbers::pi / 4 * (1 - std::clamp(dot(a, b) / l, -1.0, 1.0)) + length(cross(a, b)) / l
               : 0;
}

int steps_of(const loaders::ControlPoint* c) {
  const Vec3d first = spline_at(c, 0).derivative, middle = spline_at(c, 0.5).derivative,
              last = spline_at(c, 1).derivative;
  const double turned = turn(first, middle) + turn(middle, last);
  return std::clamp(static_cast<int>(std::ceil(turned / kTurn)), kMinSteps, kMaxSteps);
}

void add_section(std::vector<Section>& sections, const SplinePoint& at) {
  const double speed = length(at.derivative);
  Section section{at.p, {}, at.radius, 0};
  if (speed > 0 && std::isfinite(1 / speed)) {
    section.tangent = at.derivative / speed;
    section.slope = at.radius_derivative / speed;
  } else if (!sections.empty()) {
    section.tangent = sections.back().tangent;
  } else {
    section.tangent = {0, 0, 1};
  }
  sections.push_back(section);
}

// The sections of a piece, without the first one if it follows another piece.
void add_piece(std::vector<Section>& sections, const loaders::ControlPoint* c) {
  const int steps = steps_of(c);
  for (int k = sections.empty() ? 0 : 1; k <= steps; ++k)
    add_section(sections, spline_at(c, static_cast<double>(k) / steps));
}

// Sections of a curve, which are not continued when there are more than `max_sections`.
std::vector<Section> bspline_sections(const loaders::Curve& curve, std::size_t max_sections) {
  std::vector<Section> sections;
  for (std::size_t i = 0; i + 3 < curve.size() && sections.size() <= max_sections; ++i)
    add_piece(sections, &curve[i]);
  return sections;
}

std::vector<Section> piece_sections(const loaders::PieceList& pieces, std::size_t max_sections) {
  std::vector<Section> sections;
  for (std::size_t i = 0; i < pieces.size() && sections.size() <= max_sections; ++i)
    add_piece(sections, pieces[i].data());
  return sections;
}

std::vector<Section> linear_sections(const loaders::Curve& curve, std::size_t /*max_sections*/) {
  std::vector<Section> sections;
  for (const loaders::ControlPoint& point : curve)
    if (sections.empty() || length(point.p - sections.back().p) > 0)
      sections.push_back({point.p, {0, 0, 1}, point.radius, 0});
  for (std::size_t i = 0; i < sections.size(); ++i) {
    const std::size_t before = i == 0 ? 0 : i - 1, after = std::min(i + 1, sections.size() - 1);
    Vec3d sum;
    double way = 0;
    for (const auto& [from, to] : {std::pair(before, i), std::pair(i, after)}) {
      const Vec3d step = sections[to].p - sections[from].p;
      const double l = length(step);
      if (l > 0) sum += step / l;
      way += l;
    }
    const double l = length(sum);
    if (l > 1e-6)
      sections[i].tangent = sum / l;
    else if (i > 0)
      sections[i].tangent = sections[i - 1].tangent;
    if (way > 0) sections[i].slope = (sections[after].radius - sections[before].radius) / way;
  }
  return sections;
}

Vec3d any_normal(Vec3d tangent) {
  const Vec3d axis = std::abs(tangent.x) < 0.6 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  return normalize(axis - tangent * dot(axis, tangent));
}

// The rings of one curve. u goes around, v along it.
void add_tube(const std::vector<Section>& sections, std::size_t sides, loaders::Mesh& mesh) {
  if (sections.size() < 2) return;
  const double step = 2 * std::numbers::pi / static_cast<double>(sides);
  // The mean width of a regular polygon is its perimeter over pi.
  float half_sine = 0, half_cosine = 0;
  math::sincosf(static_cast<float>(step / 2), half_sine, half_cosine);
  const double widen = step / 2 / static_cast<double>(half_sine);
  double total = 0;
  for (std::size_t i = 1; i < sections.size(); ++i) total += length(sections[i].p - sections[i - 1].p);
  double way = 0;
  Vec3d normal = any_normal(sections[0].tangent);
  const auto base = static_cast<std::uint32_t>(mesh.positions.size());
  const auto ring = static_cast<std::uint32_t>(sides + 1);  // the seam has two columns of texture coordinates
  for (std::size_t i = 0; i < sections.size(); ++i) {
    const Section& section = sections[i];
    if (i > 0) way += length(section.p - sections[i - 1].p);
    const Vec3d carried = normal - section.tangent * dot(normal, section.tangent);
    normal = length(carried) > 1e-6 ? normalize(carried) : any_normal(section.tangent);
    const Vec3d binormal = cross(section.tangent, normal);
    for (std::size_t k = 0; k <= sides; ++k) {
      float sine = 0, cosine = 0;
      math::sincosf(static_cast<float>(step * static_cast<double>(k % sides)), sine, cosine);
      const Vec3d out = normal * static_cast<double>(cosine) + binormal * static_cast<double>(sine);
      mesh.positions.push_back(Vec3(section.p + out * (section.radius * widen)));
      mesh.normals.push_back(Vec3(normalize(out - section.tangent * section.slope)));
      mesh.uvs.push_back({static_cast<float>(k) / static_cast<float>(sides),
                          static_cast<float>(total > 0 ? way / total : 0)});
    }
  }
  for (std::uint32_t i = 0; i + 1 < sections.size(); ++i) {
    for (std::uint32_t k = 0; k + 1 < ring; ++k) {
      const std::uint32_t a = base + i * ring + k, b = a + ring;
      mesh.triangles.push_back({a, a + 1, b + 1});
      mesh.triangles.push_back({a, b + 1, b});
    }
  }
}

template <class Curve, class Sections>
Result<loaders::Mesh> tubes(const std::vector<Curve>& curves, const Sections& sections_of,
                            std::size_t max_triangles) {
  const std::size_t max_sections = max_triangles / (2 * kMinSides);
  std::vector<std::vector<Section>> all;
  std::size_t count = 1;  // of sections
  for (const Curve& curve : curves) {
    work_step();
    all.push_back(sections_of(curve, max_sections - std::min(count, max_sections)));
    count += all.back().size();
    if (count > max_sections)
      return input_error("the curves of the shape are tubes of more than " + std::to_string(max_triangles) +
                         " triangles");
  }
  const std::size_t sides = std::clamp(kVertexBudget / count, kMinSides, kMaxSides);
  loaders::Mesh mesh;
  for (const auto& sections : all) {
    work_step();
    add_tube(sections, sides, mesh);
  }
  return mesh;
}

}  // namespace

Result<loaders::Mesh> bspline_tubes(const std::vector<loaders::Curve>& curves, std::size_t max_triangles) {
  return tubes(curves, bspline_sections, max_triangles);
}

Result<loaders::Mesh> linear_tubes(const std::vector<loaders::Curve>& curves, std::size_t max_triangles) {
  return tubes(curves, linear_sections, max_triangles);
}

Result<loaders::Mesh> piecewise_tubes(const std::vector<loaders::PieceList>& curves,
                                      std::size_t max_triangles) {
  CANDELA_ASSIGN(loaders::Mesh mesh, tubes(curves, piece_sections, max_triangles));
  for (Vec2& uv : mesh.uvs) std::swap(uv.x, uv.y);
  return mesh;
}

}  // namespace candela::scene
