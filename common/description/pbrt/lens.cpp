#include "common/description/pbrt/lens.h"

#include <fmt/format.h>

#include <cmath>
#include <vector>

#include "common/description/check.h"
#include "common/description/text.h"

namespace candela::description::pbrt {
namespace {

constexpr std::size_t max_lens_bytes = std::size_t{1} << 20;

// A row of the file, in millimeters, from the front to the film.
struct LensSurface {
  double curvature_radius, thickness, index, diameter;  // a curvature radius of 0 is the aperture stop
};

Result<std::vector<LensSurface>> read_surfaces(Context& context, const Location& where,
                                               const std::string& key) {
  CANDELA_ASSIGN(const FileSource::Bytes bytes, context.open(key, max_lens_bytes));
  std::vector<double> numbers;
  int line = 0;
  for (std::string_view rest = bytes.view; !rest.empty();) {
    ++line;
    const std::size_t end = rest.find('\n');
    const std::string_view row = rest.substr(0, end);
    rest = end == std::string_view::npos ? std::string_view() : rest.substr(end + 1);
    for (const std::string_view word : text::tokens(row.substr(0, row.find('#')))) {
      const std::optional<double> number = text::to_number(word);
      if (!number) return error_at({key, line}, fmt::format("{} is no finite number", text::quote(word)));
      numbers.push_back(*number);
    }
  }
  if (numbers.empty() || numbers.size() % 4 != 0)
    return error_at(where, fmt::format("the lens file {} has {} numbers, not four for each surface",
                                       text::quote(key), numbers.size()));
  std::vector<LensSurface> surfaces;
  for (std::size_t i = 0; i < numbers.size(); i += 4)
    surfaces.push_back({numbers[i], numbers[i + 1], numbers[i + 2], numbers[i + 3]});
  return surfaces;
}

}  // namespace

Result<ThinLens> realistic_lens(Context& context, Entity& camera) {
  ParameterList& parameters = camera.parameters;
  CANDELA_ASSIGN(const std::string file, parameters.text("lensfile", ""));
  if (file.empty())
    return error_at(camera.where, "camera 'realistic' needs a lens file")
        .with_mend("write \"string lensfile\" \"lenses/wide.22mm.dat\"");
  CANDELA_ASSIGN(const std::string key, context.find_file(camera.where, file));
  CANDELA_ASSIGN(const double diameter, parameters.number("aperturediameter", 1));
  CANDELA_ASSIGN(const double focus, parameters.number("focusdistance", 10));
  parameters.ignore({"aperture"});
  CANDELA_ASSIGN(const std::vector<LensSurface> surfaces, read_surfaces(context, camera.where, key));
  // A ray parallel to the axis at the height 1: its height at the stop, and its slope behind the lenses.
  double height = 1, slope = 0, index = 1, at_stop = 1, stop_diameter = diameter;
  for (const LensSurface& surface : surfaces) {
    if (surface.curvature_radius == 0) {
      at_stop = height;
      stop_diameter = std::min(diameter, surface.diameter);
    } else {
      const double next = surface.index == 0 ? 1 : surface.index;
      slope = (index * slope - height * (next - index) / surface.curvature_radius) / next;
      index = next;
    }
    if (&surface != &surfaces.back()) height += slope * surface.thickness;
  }
  constexpr double meters = 1e-3;
  const double focal_length = -meters / slope;
  if (!(focal_length > 0) || !std::isfinite(focal_length))
    return error_at(camera.where, fmt::format("the lenses of {} do not gather light", text::quote(key)));
  if (!(focus > focal_length))
    return error_at(camera.where,
                    fmt::format("'focusdistance' is not above the focal length, {}", focal_length));
  ThinLens lens;
  lens.radius = meters * stop_diameter / 2 / std::abs(at_stop);
  lens.focus_distance = focus;
  lens.image_distance = focal_length * focus / (focus - focal_length);
  if (!(lens.radius > 0) || !std::isfinite(lens.radius))
    return error_at(camera.where, fmt::format("the lenses of {} let no light through", text::quote(key)));
  return lens;
}

}  // namespace candela::description::pbrt
