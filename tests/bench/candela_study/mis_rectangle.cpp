#include "tests/bench/candela_study/mis_rectangle.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/mis_problems.h"

namespace candela::study {
namespace {

constexpr int kPatchPanels = 2, kTrianglePanels = 8;  // of 10 points, of a side
constexpr std::uint32_t kShownSide = 49;              // points of a picture's side

double dot(const LampPlace& a, const LampPlace& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
LampPlace cross(const LampPlace& a, const LampPlace& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
double length(const LampPlace& a) {
  return std::sqrt(dot(a, a));
}
LampPlace mix(const LampPlace& a, const LampPlace& b, double t) {
  return {a.x + t * (b.x - a.x), a.y + t * (b.y - a.y), a.z + t * (b.z - a.z)};
}

// The part of a polygon whose heights are not negative.
std::vector<LampPlace> clipped(const std::vector<LampPlace>& polygon, const std::vector<double>& heights) {
  std::vector<LampPlace> out;
  for (std::size_t k = 0; k < polygon.size(); ++k) {
    const std::size_t next = (k + 1) % polygon.size();
    if (heights[k] >= 0) out.push_back(polygon[k]);
    if ((heights[k] > 0 && heights[next] < 0) || (heights[k] < 0 && heights[next] > 0))
      out.push_back(mix(polygon[k], polygon[next], heights[k] / (heights[k] - heights[next])));
  }
  return out;
}

// Solid angle of [x0, x1] x [y0, y1] at height z, of two triangles [Oosterom 1983].
double solid_angle_of(double x0, double x1, double y0, double y1, double z) {
  const auto triangle = [&](const LampPlace& a, const LampPlace& b, const LampPlace& c) {
    const double la = length(a), lb = length(b), lc = length(c);
    return 2 * std::atan2(z * (x1 - x0) * (y1 - y0),
                          la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
  };
  const LampPlace a{x0, y0, z}, b{x1, y0, z}, c{x1, y1, z}, d{x0, y1, z};
  return triangle(a, b, c) + triangle(a, d, c);
}

// Cuts of an interval where densities over the distance z vary.
std::vector<double> cuts(double a, double b, double z) {
  std::vector<double> out = {a, b};
  if (a < 0 && b > 0) out.push_back(0);
  for (double s = z / 2; s < std::max(std::abs(a), std::abs(b)); s *= 2)
    for (const double t : {-s, s})
      if (a < t && t < b) out.push_back(t);
  std::sort(out.begin(), out.end());
  return out;
}

}  // namespace

LampOverPoint::LampOverPoint(std::string name, std::array<double, 4> rectangle, double z, LampPlace normal,
                             double clip)
    : name_(std::move(name)),
      x0_(rectangle[0]),
      x1_(rectangle[1]),
      y0_(rectangle[2]),
      y1_(rectangle[3]),
      z_(z),
      normal_{normal.x / length(normal), normal.y / length(normal), normal.z / length(normal)},
      corners_{{x0_, y0_, z}, {x1_, y0_, z}, {x1_, y1_, z}, {x0_, y1_, z}} {
  solid_angle_ = solid_angle_of(x0_, x1_, y0_, y1_, z_);
  std::vector<double> heights;
  for (const LampPlace& corner : corners_) heights.push_back(dot(corner, normal_));
  lit_ = clipped(corners_, heights);
  const auto [least, most] = std::minmax_element(heights.begin(), heights.end());
  whole_ = *least >= clip * *most;
  clip_height_ = clip * *most;
  for (double& h : heights) h -= clip_height_;
  kept_ = whole_ ? corners_ : clipped(corners_, heights);
  for (std::size_t k = 1; k + 1 < kept_.size(); ++k) {
    const Triangle t{{kept_[0], kept_[k], kept_[k + 1]}, 0};
    double product = 2;
    for (const LampPlace& corner : t.corners) product *= dot(corner, normal_);
    const double determinant = dot(t.corners[0], cross(t.corners[1], t.corners[2]));
    triangles_.push_back({t.corners, std::abs(determinant) / product});
    parallel_area_ += triangles_.back().area;
  }
}

double LampOverPoint::irradiance() const {
  double sum = 0;
  for (std::size_t k = 0; k < lit_.size(); ++k) {
    const LampPlace &a = lit_[k], &b = lit_[(k + 1) % lit_.size()], c = cross(a, b);
    sum += std::atan2(length(c), dot(a, b)) * dot(c, normal_) / length(c);
  }
  return std::abs(sum / 2);
}

// The x left of which the rectangle has this share of its solid angle: the closed form of [Urena 2013], and
// one Newton step that removes its cancellation.
double LampOverPoint::x_from_share(double share) const {
  const double a0 = -x0_ / std::hypot(x0_, z_), b0 = -y0_ / std::hypot(y0_, z_),
               b1 = y1_ / std::hypot(y1_, z_);
  const double phi = share * solid_angle_ + 2 * std::numbers::pi - std::acos(-a0 * b0) - std::acos(-a0 * b1);
  const double t = (b0 * std::cos(phi) - b1) / std::sin(phi);
  const double a = std::copysign(1 / std::sqrt(t * t + b0 * b0), t);
  double x = std::clamp(a * z_ / std::sqrt(std::max(1 - a * a, 1e-300)), x0_, x1_);
  const double slope =
      z_ * (y1_ / std::sqrt(x * x + y1_ * y1_ + z_ * z_) - y0_ / std::sqrt(x * x + y0_ * y0_ + z_ * z_));
  x -= (solid_angle_of(x0_, x, y0_, y1_, z_) - share * solid_angle_) * (x * x + z_ * z_) / slope;
  return std::clamp(x, x0_, x1_);
}

std::array<double, 2> LampOverPoint::sample(Technique technique, double u, double v) const {
  if (technique == area) return {coordinate(0, u), coordinate(1, v)};
  if (technique == spherical) {
    const double x = x_from_share(u), d = x * x + z_ * z_;
    const double k0 = y0_ / std::sqrt(d + y0_ * y0_), k1 = y1_ / std::sqrt(d + y1_ * y1_);
    const double k = k0 + v * (k1 - k0);
    return {x, std::clamp(k * std::sqrt(d / (1 - k * k)), y0_, y1_)};
  }
  double rest = u * parallel_area_;
  std::size_t at = 0;
  while (at + 1 < triangles_.size() && rest >= triangles_[at].area) rest -= triangles_[at++].area;
  const double root = std::sqrt(std::min(1.0, rest / triangles_[at].area));
  const std::array<double, 3> weights = {1 - root, root * (1 - v), root * v};
  LampPlace direction{};
  for (std::size_t k = 0; k < 3; ++k) {
    const LampPlace& corner = triangles_[at].corners[k];
    const double scale = weights[k] / dot(corner, normal_);
    direction = {direction.x + scale * corner.x, direction.y + scale * corner.y,
                 direction.z + scale * corner.z};
  }
  return {std::clamp(direction.x * z_ / direction.z, x0_, x1_),
          std::clamp(direction.y * z_ / direction.z, y0_, y1_)};
}

MisPoint LampOverPoint::at(double x, double y) const {
  const LampPlace v{x, y, z_};
  const double r = length(v), height = dot(v, normal_), cosine = height / r;
  MisPoint point;
  point.weight = z_ / (r * r * r);
  point.f = std::max(cosine, 0.0);
  point.p[spherical] = 1 / solid_angle_;
  point.p[area] = 1 / ((x1_ - x0_) * (y1_ - y0_) * point.weight);
  if (height >= (whole_ ? 0 : clip_height_))
    point.p[parallel] = 1 / (parallel_area_ * cosine * cosine * cosine);
  return point;
}

std::vector<MisPoint> LampOverPoint::points() const {
  std::vector<MisPoint> out;
  const auto add = [&](double x, double y, double area_weight) {
    out.push_back(at(x, y));
    out.back().weight *= area_weight;
  };
  std::vector<double> heights;
  for (const LampPlace& corner : corners_) heights.push_back(dot(corner, normal_));
  if (whole_ && *std::min_element(heights.begin(), heights.end()) > 0) {
    const std::vector<test::MisNode> nodes = test::mis_nodes({}, kPatchPanels);
    const std::vector<double> xs = cuts(x0_, x1_, z_), ys = cuts(y0_, y1_, z_);
    for (std::size_t i = 0; i + 1 < xs.size(); ++i)
      for (std::size_t j = 0; j + 1 < ys.size(); ++j) {
        const double dx = xs[i + 1] - xs[i], dy = ys[j + 1] - ys[j];
        for (const test::MisNode& u : nodes)
          for (const test::MisNode& v : nodes)
            add(xs[i] + dx * u.x, ys[j] + dy * v.x, dx * dy * u.weight * v.weight);
      }
    return out;
  }
  // By triangles of the parts that are kept, lit but left out, and dark.
  const std::vector<test::MisNode> nodes = test::mis_nodes({}, kTrianglePanels);
  std::vector<double> below, dark;
  for (const LampPlace& corner : lit_) below.push_back(clip_height_ - dot(corner, normal_));
  for (const double h : heights) dark.push_back(-h);
  for (const std::vector<LampPlace>& polygon : {kept_, clipped(lit_, below), clipped(corners_, dark)})
    for (std::size_t k = 1; k + 1 < polygon.size(); ++k) {
      const LampPlace &a = polygon[0], &b = polygon[k], &c = polygon[k + 1];
      const double doubled = std::abs((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x));
      for (const test::MisNode& s : nodes)
        for (const test::MisNode& t : nodes) {
          const LampPlace far = mix(b, c, t.x), place = mix(a, far, s.x);
          add(place.x, place.y, doubled * s.x * s.weight * t.weight);
        }
    }
  return out;
}

double LampOverPoint::coordinate(std::size_t axis, double u) const {
  return axis == 0 ? x0_ + u * (x1_ - x0_) : y0_ + u * (y1_ - y0_);
}

std::vector<LampOverPoint> lamps_over_points() {
  const std::array<double, 4> wide = {-.5, 1.5, -1, .5}, square = {-1, 1, -1, 1};
  return {{"R1", wide, 1, {0, 0, 1}},     {"R2", wide, 1, {.5, .3, 1}},
          {"R3", wide, 1, {1, 0, .3}},    {"R4", square, .2, {0, 0, 1}},
          {"R5", square, .5, {.4, 0, 1}}, {"R6", {-.05, .05, -.05, .05}, 50, {0, 0, 1}}};
}

MisCase lamp_case(const LampOverPoint& lamp, const std::vector<LampOverPoint::Technique>& techniques) {
  const auto chosen = [techniques](const MisPoint& all) {
    MisPoint point{all.weight, all.f, {}};
    for (std::size_t i = 0; i < techniques.size(); ++i) point.p[i] = all.p[techniques[i]];
    return point;
  };
  MisCase problem;
  problem.name = lamp.name() + " ";
  for (std::size_t i = 0; i < techniques.size(); ++i)
    problem.name += (i == 0 ? "" : "+") + std::string(LampOverPoint::kNames[techniques[i]]);
  problem.allocation = mis::Allocation::ones(techniques.size());
  for (const MisPoint& point : lamp.points()) problem.points.push_back(chosen(point));
  problem.shown_width = kShownSide;
  for (std::uint32_t k = 0; k < kShownSide * kShownSide; ++k)
    problem.shown.push_back(chosen(lamp.at(lamp.coordinate(0, (k % kShownSide + 0.5) / kShownSide),
                                           lamp.coordinate(1, (k / kShownSide + 0.5) / kShownSide))));
  problem.draw = [lamp, techniques, chosen, allocation = problem.allocation](rng::Stream& random,
                                                                             std::vector<MisSample>& out) {
    for (const LampOverPoint::Technique technique : techniques) {
      const double u = random.next_double(), v = random.next_double();
      const auto [x, y] = lamp.sample(technique, u, v);
      out.push_back(sample_at(allocation, chosen(lamp.at(x, y))));
    }
  };
  return problem;
}

}  // namespace candela::study
