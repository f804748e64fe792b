// Figures of `candela inspect paths` and `sphere`: meshes as PLY, and paths drawn over a picture.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/image/lettering.h"
#include "worker/inspect/paths.h"
#include "worker/inspect/radiance.h"
#include "worker/inspect/session.h"

namespace candela::client {

// The color of a group by its place in the list.
image::Color8 group_color(std::size_t group);

// Triangles with a color at each vertex.
class ColoredMesh {
 public:
  std::uint32_t add_vertex(Vec3d p, image::Color8 color);
  void add_face(std::uint32_t a, std::uint32_t b, std::uint32_t c) { faces_.push_back({a, b, c}); }
  // A tube of six sides; an arrow ends in a cone at b.
  void add_tube(Vec3d a, Vec3d b, double radius, image::Color8 color);
  void add_arrow(Vec3d a, Vec3d b, double radius, image::Color8 color);
  std::string to_ply() const;  // ASCII

 private:
  struct Point {
    Vec3d p;
    image::Color8 color;
  };
  void add_side(Vec3d a, double radius_a, Vec3d b, double radius_b, image::Color8 color);
  std::vector<Point> points_;
  std::vector<std::array<std::uint32_t, 3>> faces_;
};

// Arrows from the light to the eye: thin ones along key paths, and a thick one along each group's mean path,
// whose cross-section goes with its share.
std::string paths_ply(const inspect::Session& session, const inspect::PathsReport& report);
// A sphere around `center` whose radius goes with the luminance that arrives from each direction; the largest
// is `size`.
std::string lobe_ply(const inspect::RadianceMap& map, Vec3d center, double size, image::ColorMap colors,
                     double white);

// The picture of the camera with key paths, the rectangle of the pixels, and a legend.
image::Canvas paths_overlay(const inspect::Session& session, const inspect::PathsReport& report,
                            const inspect::PixelRect& pixels, unsigned threads);

}  // namespace candela::client
