#include "common/image/lettering.h"

#include <algorithm>
#include <cmath>

namespace candela::image {
namespace {

// A character of the font: strokes, separated by blanks, each a list of points of two characters, x and y.
// x: 0 to 9, then letters; y: 3 the baseline, a the height of small letters, d the height of capitals. A
// stroke is the quadratic B-spline of its points, from the first to the last: a point given twice is a
// corner.
struct Glyph {
  char character;
  int advance;
  std::string_view strokes;
};

constexpr double kCapitalUnits = 10, kBaseline = 3;
constexpr double kSpacing = 0.5;                        // units between characters
constexpr double kStroke = 1.15;                        // thickness in units
constexpr double kRaisedSize = 0.72, kRaisedBy = 0.55;  // of a capital's height

constexpr Glyph kFont[] = {
    {' ', 4, ""},
    {'0', 8, "4d1d13737d4d"},
    {'1', 8, "1b4d4d43"},
    {'2', 8, "1b1d7d79131373"},
    {'3', 8, "1b1d7d7838 3879731315"},
    {'4', 8, "5d161676 5d53"},
    {'5', 8, "6d2d2d18 183a79731314"},
    {'6', 8, "6d1d1373791916"},
    {'7', 8, "1d7d7d33"},
    {'8', 8, "4d1d18787d4d 481813737848"},
    {'9', 8, "23737d1d17777a"},
    {'A', 10, "135d5d93 2686"},
    {'B', 8, "131d1d3d3d7d78383818 3848487873434313"},
    {'C', 8, "7b7d1d137375"},
    {'D', 9, "131d1d3d3d8d83333313"},
    {'E', 7, "6d1d1d131363 1858"},
    {'F', 7, "6d1d1d13 1858"},
    {'G', 9, "8b8d1d1383888858"},
    {'H', 9, "131d 838d 1888"},
    {'I', 2, "131d"},
    {'J', 6, "5d5656531315"},
    {'K', 8, "131d 7d17 3973"},
    {'L', 7, "1d131363"},
    {'M', 10, "131d1d56569d9d93"},
    {'N', 9, "131d1d83838d"},
    {'O', 10, "5d1d13939d5d"},
    {'P', 8, "131d1d3d3d7d77373717"},
    {'Q', 10, "5d1d13939d5d 6693"},
    {'R', 8, "131d1d3d3d7d78383818 4873"},
    {'S', 8, "7b7d1d1878731315"},
    {'T', 8, "1d7d 4d43"},
    {'U', 9, "1d1616138386868d"},
    {'V', 8, "1d43437d"},
    {'W', 12, "1d33336d6d9393bd"},
    {'X', 8, "1d73 137d"},
    {'Y', 8, "1d48487d 4843"},
    {'Z', 8, "1d7d7d131373"},
    {'a', 7, "6a63 676a1a136366"},
    {'b', 7, "1d13 171a6a631316"},
    {'c', 7, "686a1a136365"},
    {'d', 7, "6d63 676a1a136366"},
    {'e', 7, "1767676a1a136364"},
    {'f', 5, "4d2d2b2b23 1a4a"},
    {'g', 7, "676a1a136366 6a6262601011"},
    {'h', 7, "1d13 171a6a676763"},
    {'i', 2, "1a13 1d1d"},
    {'j', 3, "2a22222000 2d2d"},
    {'k', 6, "1d13 5a16 3853"},
    {'l', 3, "1d15151333"},
    {'m', 10, "1a13 171a5a575753 575a9a979793"},
    {'n', 7, "1a13 171a6a676763"},
    {'o', 8, "4a1a13737a4a"},
    {'p', 7, "1a10 171a6a631316"},
    {'q', 7, "6a60 676a1a136366"},
    {'r', 5, "1a13 171a4a"},
    {'s', 6, "595a1a1756531314"},
    {'t', 5, "2d25252343 1a4a"},
    {'u', 7, "1a1616136366 6a63"},
    {'v', 8, "1a43437a"},
    {'w', 10, "1a33335a5a73739a"},
    {'x', 7, "1a63 136a"},
    {'y', 8, "1a43 7a30"},
    {'z', 7, "1a6a6a131363"},
    {'.', 2, "1313"},
    {',', 2, "1301"},
    {':', 2, "1313 1919"},
    {'-', 6, "1757"},
    {'_', 6, "0262"},
    {'+', 8, "1878 4b45"},
    {'=', 8, "1a7a 1676"},
    {'/', 6, "125e"},
    {'%', 9, "137d 2d0d0a4a4d2d 664643838666"},
    {'(', 4, "3e0832"},
    {')', 4, "1e4812"},
    {'[', 4, "3e1e1e121232"},
    {']', 4, "1e3e3e323212"},
    {'<', 8, "7c181874"},
    {'>', 8, "1c787814"},
    {'?', 7, "1b1d6d6a3836 3333"},
    {'!', 2, "1d16 1313"},
    {'\'', 2, "1d1b"},
    {'|', 2, "1e12"},
};
constexpr Glyph kBox = {'\0', 7, "131d1d6d6d636313"};

const Glyph& glyph_of(char c) {
  const auto* const found =
      std::find_if(std::begin(kFont), std::end(kFont), [c](const Glyph& g) { return g.character == c; });
  return found == std::end(kFont) ? kBox : *found;
}

// Bytes after the first of a character in UTF-8.
bool continues(char c) {
  return (static_cast<unsigned char>(c) & 0xC0) == 0x80;
}

double units_of(std::string_view text) {
  double units = 0;
  for (const char c : text)
    if (!continues(c)) units += glyph_of(c).advance + kSpacing;
  return units;
}

constexpr int digit(char c) {
  return c <= '9' ? c - '0' : c - 'a' + 10;
}

// The points of a line that follows the B-spline of `controls`.
std::vector<Point2> follow(const std::vector<Point2>& controls) {
  constexpr int kPieces = 8;
  if (controls.size() < 3) return controls;
  const auto middle = [](Point2 a, Point2 b) { return Point2{(a.x + b.x) / 2, (a.y + b.y) / 2}; };
  std::vector<Point2> line = {controls.front()};
  for (std::size_t i = 1; i + 1 < controls.size(); ++i) {
    const Point2 from = line.back(), over = controls[i];
    const Point2 to = i + 2 == controls.size() ? controls.back() : middle(controls[i], controls[i + 1]);
    for (int k = 1; k <= kPieces; ++k) {
      const double t = static_cast<double>(k) / kPieces, s = 1 - t;
      line.push_back({s * s * from.x + 2 * s * t * over.x + t * t * to.x,
                      s * s * from.y + 2 * s * t * over.y + t * t * to.y});
    }
  }
  return line;
}

double distance_to_segment(Point2 p, Point2 a, Point2 b) {
  const double dx = b.x - a.x, dy = b.y - a.y, length2 = dx * dx + dy * dy;
  const double t = length2 > 0 ? std::clamp(((p.x - a.x) * dx + (p.y - a.y) * dy) / length2, 0.0, 1.0) : 0;
  return std::hypot(p.x - a.x - t * dx, p.y - a.y - t * dy);
}

void draw_run(Canvas& canvas, double x, double baseline, double capital, std::string_view text,
              Color8 color) {
  const double unit = capital / kCapitalUnits;
  for (const char c : text) {
    if (continues(c)) continue;
    const Glyph& glyph = glyph_of(c);
    for (std::size_t at = 0; at < glyph.strokes.size();) {
      std::vector<Point2> controls;
      for (; at < glyph.strokes.size() && glyph.strokes[at] != ' '; at += 2)
        controls.push_back({x + unit * digit(glyph.strokes[at]),
                            baseline - unit * (digit(glyph.strokes[at + 1]) - kBaseline)});
      ++at;
      const bool dot =
          controls.size() == 2 && controls[0].x == controls[1].x && controls[0].y == controls[1].y;
      draw_line(canvas, follow(controls), std::max(1.0, kStroke * unit) * (dot ? 1.3 : 1), color);
    }
    x += unit * (glyph.advance + kSpacing);
  }
}

}  // namespace

Canvas::Canvas(std::uint32_t w, std::uint32_t h, Color8 paper)
    : width(w), height(h), rgb(std::size_t{w} * h * 3) {
  for (std::size_t i = 0; i < rgb.size(); ++i) rgb[i] = paper[i % 3];
}

void Canvas::set(std::uint32_t x, std::uint32_t y, Color8 color) {
  std::copy(color.begin(), color.end(),
            rgb.begin() + static_cast<std::ptrdiff_t>(3 * (std::size_t{y} * width + x)));
}

Color8 Canvas::at(std::uint32_t x, std::uint32_t y) const {
  const std::size_t i = 3 * (std::size_t{y} * width + x);
  return {rgb[i], rgb[i + 1], rgb[i + 2]};
}

void Canvas::blend(std::uint32_t x, std::uint32_t y, Color8 color, double coverage) {
  Color8 mixed = at(x, y);
  for (std::size_t c = 0; c < 3; ++c)
    mixed[c] = static_cast<std::uint8_t>(std::lround(mixed[c] + coverage * (color[c] - mixed[c])));
  set(x, y, mixed);
}

void draw_line(Canvas& canvas, std::span<const Point2> points, double thickness, Color8 color) {
  if (points.empty()) return;
  const double radius = thickness / 2, reach = radius + 1;
  const auto [left, right] =
      std::minmax_element(points.begin(), points.end(), [](Point2 a, Point2 b) { return a.x < b.x; });
  const auto [top, bottom] =
      std::minmax_element(points.begin(), points.end(), [](Point2 a, Point2 b) { return a.y < b.y; });
  const auto bound = [](double v, std::uint32_t most) {
    return static_cast<std::uint32_t>(std::clamp(v, 0.0, static_cast<double>(most)));
  };
  const std::uint32_t x1 = bound(std::ceil(right->x + reach), canvas.width);
  const std::uint32_t y1 = bound(std::ceil(bottom->y + reach), canvas.height);
  for (std::uint32_t y = bound(top->y - reach, canvas.height); y < y1; ++y)
    for (std::uint32_t x = bound(left->x - reach, canvas.width); x < x1; ++x) {
      const Point2 center{x + 0.5, y + 0.5};
      double nearest = distance_to_segment(center, points.front(), points.front());
      for (std::size_t i = 1; i < points.size(); ++i)
        nearest = std::min(nearest, distance_to_segment(center, points[i - 1], points[i]));
      const double coverage = std::clamp(radius + 0.5 - nearest, 0.0, 1.0);
      if (coverage > 0) canvas.blend(x, y, color, coverage);
    }
}

double text_width(const Label& label, double capital) {
  const double units = units_of(label.base) + kRaisedSize * units_of(label.raised);
  return std::max(0.0, units - kSpacing) * capital / kCapitalUnits;
}

void draw_text(Canvas& canvas, double x, double baseline, double capital, const Label& label, Color8 color) {
  draw_run(canvas, x, baseline, capital, label.base, color);
  draw_run(canvas, x + units_of(label.base) * capital / kCapitalUnits, baseline - kRaisedBy * capital,
           kRaisedSize * capital, label.raised, color);
}

std::string fit_text(std::string_view text, double capital, double width) {
  if (text_width({std::string(text)}, capital) <= width) return std::string(text);
  std::string cut(text);
  while (!cut.empty() && text_width({cut + ".."}, capital) > width) {
    while (continues(cut.back()) && cut.size() > 1) cut.pop_back();
    cut.pop_back();
  }
  return cut + "..";
}

}  // namespace candela::image
