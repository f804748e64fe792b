#include "client/embedded/inspect_figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <string_view>

#include "common/image/color_map.h"
#include "common/image/image.h"

namespace candela::client {
namespace {

using image::Canvas;
using image::Color8;
using image::Point2;
using inspect::KeyPath;
using inspect::PathGroup;
using inspect::PathsReport;
using inspect::Session;

constexpr int kSides = 6;
constexpr std::uint32_t kLargestPreview = 768, kSmallestPicture = 480, kPreviewSamples = 16;

// Tab10, without its gray.
constexpr std::array<Color8, 9> kColors = {{{31, 119, 180},
                                            {255, 127, 14},
                                            {44, 160, 44},
                                            {214, 39, 40},
                                            {148, 103, 189},
                                            {227, 119, 194},
                                            {188, 189, 34},
                                            {23, 190, 207},
                                            {140, 86, 75}}};

// Two unit vectors across d.
std::pair<Vec3d, Vec3d> across(Vec3d d) {
  const Vec3d side = std::abs(d.x) < 0.6 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  const Vec3d s = normalize(cross(d, side));
  return {s, cross(d, s)};
}

float scale_to(const std::vector<float>& rgb, double percentile) {
  std::vector<float> values;
  for (std::size_t i = 0; i + 2 < rgb.size(); i += 3)
    values.push_back(luminance({rgb[i], rgb[i + 1], rgb[i + 2]}));
  if (values.empty()) return 1;
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(percentile * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at > 0 ? 1 / *at : 1;
}

// The picture, each pixel `times` wide and high, darker than it is so that lines stand out.
Canvas backdrop(const std::vector<float>& rgb, std::uint32_t width, std::uint32_t height, std::uint32_t times,
                std::uint32_t below) {
  Canvas canvas(width * times, height * times + below, {255, 255, 255});
  const float scale = scale_to(rgb, 0.95) * 0.5f;
  for (std::uint32_t y = 0; y < height * times; ++y) {
    for (std::uint32_t x = 0; x < width * times; ++x) {
      const std::size_t at = 3 * (std::size_t{y / times} * width + x / times);
      Color8 color;
      for (std::size_t c = 0; c < 3; ++c) {
        const float value =
            std::clamp(image::linear_to_srgb(std::max(rgb[at + c], 0.0f) * scale), 0.0f, 1.0f);
        color[c] = static_cast<std::uint8_t>(std::lround(255 * value));
      }
      canvas.set(x, y, color);
    }
  }
  return canvas;
}

// The visible parts of an edge in space, as the camera sees them. The eye itself has no place.
void draw_edge(Canvas& canvas, const Session& session, Vec3 a, Vec3 b, double scale, double thickness,
               Color8 color) {
  constexpr int steps = 64;
  std::optional<Point2> before;
  for (int i = 0; i <= steps; ++i) {
    const float t = static_cast<float>(i) / steps;
    const auto at = session.project(a * (1 - t) + b * t);
    std::optional<Point2> here;
    if (at) here = Point2{static_cast<double>(at->x) * scale, static_cast<double>(at->y) * scale};
    if (before && here) {
      const std::array<Point2, 2> line = {*before, *here};
      image::draw_line(canvas, line, thickness, color);
    }
    before = here;
  }
}

void draw_rect(Canvas& canvas, const inspect::PixelRect& r, double scale) {
  const double x0 = r.x0 * scale, y0 = r.y0 * scale, x1 = (r.x1 + 1) * scale, y1 = (r.y1 + 1) * scale;
  const std::array<Point2, 5> frame = {{{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}, {x0, y0}}};
  image::draw_line(canvas, frame, 3, {0, 0, 0});
  image::draw_line(canvas, frame, 1.5, {255, 255, 255});
}

}  // namespace

Color8 group_color(std::size_t group) {
  return kColors[group % kColors.size()];
}

std::uint32_t ColoredMesh::add_vertex(Vec3d p, Color8 color) {
  points_.push_back({p, color});
  return static_cast<std::uint32_t>(points_.size() - 1);
}

void ColoredMesh::add_side(Vec3d a, double radius_a, Vec3d b, double radius_b, Color8 color) {
  const auto [s, t] = across(normalize(b - a));
  const auto first = static_cast<std::uint32_t>(points_.size());
  for (int i = 0; i < kSides; ++i) {
    const double phi = 2 * std::numbers::pi * i / kSides;
    const Vec3d out = s * std::cos(phi) + t * std::sin(phi);
    add_vertex(a + out * radius_a, color);
    add_vertex(b + out * radius_b, color);
  }
  for (std::uint32_t i = 0; i < kSides; ++i) {
    const std::uint32_t here = first + 2 * i, next = first + 2 * ((i + 1) % kSides);
    add_face(here, next, here + 1);
    add_face(next, next + 1, here + 1);
  }
}

void ColoredMesh::add_tube(Vec3d a, Vec3d b, double radius, Color8 color) {
  if (length(b - a) > 0) add_side(a, radius, b, radius, color);
}

void ColoredMesh::add_arrow(Vec3d a, Vec3d b, double radius, Color8 color) {
  const double whole = length(b - a);
  if (!(whole > 0)) return;
  const double head = std::min(8 * radius, whole / 2);
  const Vec3d neck = b - (b - a) * (head / whole);
  add_tube(a, neck, radius, color);
  add_side(neck, 2.5 * radius, b, 0, color);
}

std::string ColoredMesh::to_ply() const {
  std::string text = fmt::format(
      "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face {}\n"
      "property list uchar int vertex_indices\nend_header\n",
      points_.size(), faces_.size());
  for (const Point& v : points_)
    text += fmt::format("{:.7g} {:.7g} {:.7g} {} {} {}\n", v.p.x, v.p.y, v.p.z, v.color[0], v.color[1],
                        v.color[2]);
  for (const auto& face : faces_) text += fmt::format("3 {} {} {}\n", face[0], face[1], face[2]);
  return text;
}

std::string paths_ply(const Session& session, const PathsReport& report) {
  ColoredMesh mesh;
  const double unit = static_cast<double>(session.scene().features().radius) * 2e-3;
  for (std::size_t g = 0; g < report.groups.size(); ++g) {
    const PathGroup& group = report.groups[g];
    const Color8 color = group_color(g);
    for (const KeyPath& path : group.key_paths)
      for (std::size_t i = 0; i + 1 < path.vertices.size(); ++i)
        mesh.add_arrow(session.in_file(path.vertices[i].p), session.in_file(path.vertices[i + 1].p), unit,
                       color);
    const double share = std::isfinite(group.share.value) ? std::clamp(group.share.value, 0.0, 1.0) : 0;
    for (std::size_t i = 0; i + 1 < group.mean_path.size(); ++i)
      mesh.add_arrow(session.in_file(group.mean_path[i]), session.in_file(group.mean_path[i + 1]),
                     unit * (2 + 6 * std::sqrt(share)), color);
  }
  return mesh.to_ply();
}

std::string lobe_ply(const inspect::RadianceMap& map, Vec3d center, double size, image::ColorMap colors,
                     double white) {
  ColoredMesh mesh;
  const auto value = [&](std::uint32_t x, std::uint32_t y) {
    const std::size_t at = 3 * (std::size_t{y} * map.width + x);
    return static_cast<double>(luminance({map.rgb[at], map.rgb[at + 1], map.rgb[at + 2]}));
  };
  double most = 0;
  for (std::uint32_t y = 0; y < map.height; ++y)
    for (std::uint32_t x = 0; x < map.width; ++x) most = std::max(most, value(x, y));
  for (std::uint32_t y = 0; y < map.height; ++y) {
    for (std::uint32_t x = 0; x < map.width; ++x) {
      const double v = std::max(value(x, y), 0.0);
      const Vec3d d = Vec3d(inspect::map_direction((x + 0.5) / map.width, (y + 0.5) / map.height));
      mesh.add_vertex(center + d * (most > 0 ? size * v / most : 0.0),
                      image::color_at(colors, white > 0 ? v / white : 0));
    }
  }
  for (std::uint32_t y = 0; y + 1 < map.height; ++y) {
    for (std::uint32_t x = 0; x < map.width; ++x) {
      const std::uint32_t next = (x + 1) % map.width, row = y * map.width, below = row + map.width;
      mesh.add_face(row + x, below + x, row + next);
      mesh.add_face(row + next, below + x, below + next);
    }
  }
  return mesh.to_ply();
}

Canvas paths_overlay(const Session& session, const PathsReport& report, const inspect::PixelRect& pixels,
                     unsigned threads) {
  const std::uint32_t film_width = session.settings().width, film_height = session.settings().height;
  const std::uint32_t longest = std::max(film_width, film_height);
  const double shrink = std::min(1.0, static_cast<double>(kLargestPreview) / longest);
  const auto scaled = [&](std::uint32_t extent) {
    return std::max(1U, static_cast<std::uint32_t>(std::lround(extent * shrink)));
  };
  const std::uint32_t width = scaled(film_width), height = scaled(film_height);
  const std::uint32_t times = (kSmallestPicture + std::max(width, height) - 1) / std::max(width, height);
  constexpr double capital = 10, line = 18;
  const auto below = static_cast<std::uint32_t>(line * static_cast<double>(report.groups.size()) + 10);
  Canvas canvas = backdrop(inspect::preview(session, width, height, kPreviewSamples, threads), width, height,
                           times, below);
  const double scale = static_cast<double>(width * times) / film_width;
  for (std::size_t g = report.groups.size(); g-- > 0;)
    for (const KeyPath& path : report.groups[g].key_paths)
      for (std::size_t i = 0; i + 2 < path.vertices.size(); ++i)
        draw_edge(canvas, session, path.vertices[i].p, path.vertices[i + 1].p, scale, 1.5, group_color(g));
  draw_rect(canvas, pixels, scale);
  // The legend covers what was drawn beyond the picture.
  for (std::uint32_t y = height * times; y < canvas.height; ++y)
    for (std::uint32_t x = 0; x < canvas.width; ++x) canvas.set(x, y, {255, 255, 255});
  for (std::size_t g = 0; g < report.groups.size(); ++g) {
    const double base = height * times + 5 + line * static_cast<double>(g) + 12;
    const std::array<Point2, 2> swatch = {{{6, base - capital / 2}, {26, base - capital / 2}}};
    image::draw_line(canvas, swatch, 4, group_color(g));
    std::string expression = report.groups[g].expression;
    constexpr std::string_view unsplit = "[DGSV]*";  // the font has no star
    if (const std::size_t at = expression.find(unsplit); at != std::string::npos)
      expression.replace(at, unsplit.size(), "..");
    const std::string text = fmt::format("{:5.1f} %  {}", 100 * report.groups[g].share.value, expression);
    image::draw_text(canvas, 36, base, capital, {image::fit_text(text, capital, canvas.width - 42.0)},
                     {0, 0, 0});
  }
  return canvas;
}

}  // namespace candela::client
