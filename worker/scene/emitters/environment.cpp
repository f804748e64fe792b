// Environment emitters. The map's sampling tables follow its bilinear cells: a cell is the patch of the
// sphere between four neighboring texels; it is chosen by the mean luminance of the four times its solid
// angle, and sampled uniformly within. So the density is above zero wherever the radiance is, and constant
// over each cell. Guide tables say between which cells a draw falls (Chen and Asau 1974), so that few places
// of the tables are read: those of a large map are far apart in memory.
#include "worker/scene/emitters/environment.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "common/base/work_monitor.h"
#include "worker/core/math.h"
#include "worker/core/warp.h"
#include "worker/scene/emitters/cone.h"
#include "worker/scene/emitters/daylight.h"
#include "worker/scene/emitters/equal_area.h"

namespace candela::scene {

struct Environment::Map {
  std::shared_ptr<const TexelImage> image;
  float scale = 1;
  Frame to_world;                       // columns of the rotation (or rotation with a reflection)
  std::uint32_t columns = 0, rows = 0;  // cells; texels are columns x (rows + 1)
  std::vector<float> row_cdf;           // rows + 1
  std::vector<std::uint32_t> row_guide;
  // For each row columns + 1 floats, and guides_of(columns) integers of 32 bits. Where large textures lie.
  ScratchBlock cell_tables;
  // rows + 1: the cosine of the polar angle at the rows' edges, falling from 1 to -1. Double: the difference
  // of two near a pole is the solid angle of a row.
  std::vector<double> edge_cos;

  static std::uint32_t guides_of(std::uint32_t cells) { return (cells + 7) / 8; }
  const std::byte* table_of(std::uint32_t row) const {
    static_assert(sizeof(float) == sizeof(std::uint32_t));
    const std::size_t entries = std::size_t{columns} + 1 + guides_of(columns);
    return cell_tables.data() + row * entries * sizeof(float);
  }
  const float* cells_of(std::uint32_t row) const { return reinterpret_cast<const float*>(table_of(row)); }
  const std::uint32_t* guide_of(std::uint32_t row) const {
    return reinterpret_cast<const std::uint32_t*>(table_of(row)) + columns + 1;
  }
  float cell_solid_angle(std::uint32_t row) const {
    return static_cast<float>((edge_cos[row] - edge_cos[row + 1]) * (2 * std::numbers::pi / columns));
  }
  // (u W - 1/2, v (H - 1)): the cell and the place within it.
  void locate(Vec3 d, double& x, double& y) const {
    const Vec3 l = to_world.to_local(d);
    const double phi = math::atan2f(l.x, -l.z);
    const double theta =
        math::atan2f(std::sqrt(l.x * l.x + l.z * l.z), l.y);  // acos(y) is imprecise near the poles
    x = phi * (columns / (2 * std::numbers::pi)) - 0.5;
    y = theta * (rows / std::numbers::pi);
  }
  std::uint32_t column_of(double floor_x) const {
    auto c = static_cast<std::int64_t>(floor_x) % columns;
    if (c < 0) c += columns;
    return static_cast<std::uint32_t>(c);
  }
};

namespace {

Error error_at(std::string message, const description::Object& object, std::string_view property) {
  description::Location where = object.where;
  if (const description::Property* p = object.find(property)) where = p->where;
  return input_error(std::move(message)).at(where.file, where.line).with_field(std::string(property));
}

// The directions that to_world maps the axes to; they must stay orthogonal and of one length.
Result<Frame> directions(const description::Object& object) {
  const description::Mat4 m = object.get_transform("to_world");
  TVec3<double> axis[3];
  for (std::size_t c = 0; c < 3; ++c) axis[c] = {m[c], m[4 + c], m[8 + c]};
  const double len = length(axis[0]);
  for (std::size_t c = 0; c < 3; ++c) {
    const double l = length(axis[c]);
    if (!(l > 0) || !(std::abs(l - len) <= 1e-4 * len) ||
        !(std::abs(dot(axis[c], axis[(c + 1) % 3])) <= 1e-4 * len * len)) {
      return error_at(
          "the to_world of an environment rotates, mirrors or scales evenly; this one shears or stretches",
          object, "to_world");
    }
  }
  // Gram-Schmidt: what is left of the rounding in the file.
  const auto a = normalize(axis[0]);
  const auto b = normalize(axis[1] - a * dot(a, axis[1]));
  const auto c = normalize(axis[2] - a * dot(a, axis[2]) - b * dot(b, axis[2]));
  return Frame{Vec3(a), Vec3(b), Vec3(c)};
}

// The last i of [0, n) with cdf[i] <= u: never a cell of zero width for u in [0, 1).
std::uint32_t find_interval(const float* cdf, std::uint32_t n, float u) {
  const float* it = std::upper_bound(cdf, cdf + n + 1, u);
  const auto i = static_cast<std::int64_t>(it - cdf) - 1;
  return static_cast<std::uint32_t>(std::clamp<std::int64_t>(i, 0, n - 1));
}

// By entry of a guide table: the interval of its least u.
void make_guide(const float* cdf, std::uint32_t n, std::span<std::uint32_t> guide) {
  for (std::size_t i = 0; i < guide.size(); ++i)
    guide[i] = find_interval(cdf, n, static_cast<float>(i) / static_cast<float>(guide.size()));
}

// As find_interval.
std::uint32_t find_guided(const float* cdf, std::uint32_t n, const std::uint32_t* guide, std::uint32_t guides,
                          float u) {
  const std::uint32_t i = std::min(static_cast<std::uint32_t>(u * static_cast<float>(guides)), guides - 1);
  const std::uint32_t low = guide[i], high = i + 1 < guides ? guide[i + 1] : n - 1;
  if (!(cdf[low] <= u && u < cdf[high + 1])) return find_interval(cdf, n, u);  // rounding of the entry
  return static_cast<std::uint32_t>(std::upper_bound(cdf + low + 1, cdf + high + 1, u) - cdf) - 1;
}

// Sums of `weights` normalized to end at exactly 1; false where all are zero. A positive weight always gets a
// positive width, at least one step of the float at its place, as far as there are steps.
bool make_cdf(const std::vector<double>& weights, float* cdf) {
  double total = 0;
  for (const double w : weights) total += w;
  cdf[0] = 0;
  if (!(total > 0)) return false;
  double sum = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    sum += weights[i];
    cdf[i + 1] = std::max(cdf[i], static_cast<float>(std::min(1.0, sum / total)));
  }
  // From the last cell of positive weight on: exactly 1.
  for (std::size_t i = weights.size(); i > 0; --i) {
    cdf[i] = 1;
    if (weights[i - 1] > 0) break;
  }
  return true;
}

// The z of the direction at (u, v) of the map, u and v in [0, 1].
double height(double u, double v) {
  double sin_theta = 0, cos_theta = 0, sin_phi = 0, cos_phi = 0;
  math::sincos(std::numbers::pi * v, sin_theta, cos_theta);
  math::sincos(2 * std::numbers::pi * u, sin_phi, cos_phi);
  return -sin_theta * cos_phi;
}

// The image of an envmap's file or of daylight.
Result<std::shared_ptr<const TexelImage>> image_of(const description::Object& object,
                                                   TextureStore& textures) {
  if (is_daylight(object)) {
    CANDELA_ASSIGN(TexelImage image, daylight_image(object, textures.scratch()));
    return std::shared_ptr<const TexelImage>(std::make_shared<const TexelImage>(std::move(image)));
  }
  if (object.plugin != "envmap")
    return error_at("'" + object.plugin + "' is no environment emitter", object, "");
  const std::string file = object.get_string("filename", "");
  if (file.empty()) return error_at("an envmap needs a file", object, "filename");
  const description::Property* named = object.find("filename");
  CANDELA_ASSIGN(std::shared_ptr<const TexelImage> image,
                 textures.image(file, {}, named != nullptr ? named->where : object.where));
  if (object.get_string("mapping", "latlong") == "equalarea") {
    if (image->width != image->height || image->width > 65536)
      return error_at("a picture of the mapping 'equalarea' is square, of at most 65536 pixels a side",
                      object, "filename");
    CANDELA_ASSIGN(TexelImage rows, latitude_longitude(*image, textures.scratch()));
    return std::shared_ptr<const TexelImage>(std::make_shared<const TexelImage>(std::move(rows)));
  }
  if (image->width < 2 || image->height < 3)
    return error_at("an environment map has at least 2 x 3 pixels", object, "filename");
  return image;
}

}  // namespace

Environment Environment::constant(Spectrum radiance) {
  Environment e;
  e.mean_radiance_ = radiance;
  e.max_luminance_ = luminance(radiance);
  return e;
}

Result<Environment> Environment::build(const description::Object& object, TextureStore& textures) {
  if (object.plugin == "constant") {
    CANDELA_ASSIGN(const ColorTexture color, textures.color(object, "radiance", Spectrum(1)));
    if (!color.is_constant())
      return error_at("the radiance of a constant emitter is one color", object, "radiance");
    return constant(color.constant);
  }
  CANDELA_ASSIGN(const std::shared_ptr<const TexelImage> image, image_of(object, textures));
  double scale = is_daylight(object) ? 1.0 : object.get_number("scale", 1);
  const bool to_illuminance = object.find("illuminance") != nullptr;
  if (to_illuminance && object.get_string("mapping", "latlong") != "equalarea")
    return error_at("illuminance needs the mapping 'equalarea'", object, "illuminance");
  if (!(scale >= 0) || !std::isfinite(static_cast<float>(scale))) {
    return error_at("the scale is finite and not negative", object, "scale");
  }
  auto map = std::make_shared<Map>();
  CANDELA_ASSIGN(map->to_world, directions(object));
  map->image = image;
  map->columns = image->width;
  map->rows = image->height - 1;
  map->edge_cos.resize(map->rows + 1);
  for (std::uint32_t r = 0; r <= map->rows; ++r) {
    // Reduced by hand, so that both poles are approached by small arguments.
    const double theta = std::numbers::pi * r / map->rows;
    const double from_pole = std::min(theta, std::numbers::pi - theta);
    const double cosine = from_pole < std::numbers::pi / 4
                              ? math::detail::cos_kernel(from_pole)
                              : math::detail::sin_kernel(std::numbers::pi / 2 - from_pole);
    map->edge_cos[r] = 2 * r <= map->rows ? cosine : -cosine;
  }
  map->edge_cos.front() = 1;
  map->edge_cos.back() = -1;

  Environment e;
  std::vector<float> cells(map->columns + 1);
  std::vector<std::uint32_t> guide(Map::guides_of(map->columns));
  CANDELA_ASSIGN(
      Scratch::Writer table,
      textures.scratch().begin(std::uint64_t{map->rows} * (cells.size() + guide.size()) * sizeof(float)));
  map->row_cdf.resize(map->rows + 1);
  std::vector<double> row_weights(map->rows);
  std::vector<double> cell_weights(map->columns);
  double mean[3] = {0, 0, 0};
  double squares = 0, onto_plane = 0;
  float brightest = 0;
  for (std::uint32_t r = 0; r < map->rows; ++r) {
    work_step();
    const double solid_angle = map->cell_solid_angle(r);
    double row = 0;
    for (std::uint32_t c = 0; c < map->columns; ++c) {
      const std::uint32_t next = c + 1 == map->columns ? 0 : c + 1;
      const Spectrum corners[4] = {image->at(c, r), image->at(next, r), image->at(c, r + 1),
                                   image->at(next, r + 1)};
      double weight = 0;
      for (const Spectrum& s : corners) {
        weight += luminance(s);
        brightest = std::max(brightest, luminance(s));
        mean[0] += s.r * solid_angle;
        mean[1] += s.g * solid_angle;
        mean[2] += s.b * solid_angle;
      }
      cell_weights[c] = weight * solid_angle;
      if (to_illuminance)
        onto_plane +=
            cell_weights[c] / 4 * std::max(0.0, height((c + 1.0) / map->columns, (r + 0.5) / map->rows));
      squares += weight * weight * solid_angle;
      row += cell_weights[c];
    }
    row_weights[r] = row;
    std::fill(cells.begin(), cells.end(), 0.0f);
    make_cdf(cell_weights, cells.data());
    make_guide(cells.data(), map->columns, guide);
    CANDELA_TRY(table.append(std::as_bytes(std::span(cells))));
    CANDELA_TRY(table.append(std::as_bytes(std::span(guide))));
  }
  CANDELA_ASSIGN(map->cell_tables, table.finish());
  if (to_illuminance) {
    scale = object.get_number("illuminance", 0) / onto_plane;
    if (!std::isfinite(static_cast<float>(scale)))
      return error_at("the upper half of the picture is black", object, "illuminance");
  }
  map->scale = static_cast<float>(scale);
  const double to_mean = scale / (4 * 4 * std::numbers::pi);
  const Spectrum m = {static_cast<float>(mean[0] * to_mean), static_cast<float>(mean[1] * to_mean),
                      static_cast<float>(mean[2] * to_mean)};
  if (!std::isfinite(m.r) || !std::isfinite(m.g) || !std::isfinite(m.b)) {
    return error_at("the map's values times scale leave the range of floats", object, "scale");
  }
  if (!make_cdf(row_weights, map->row_cdf.data()) || m.is_black()) return constant(Spectrum());
  e.mean_radiance_ = m;
  e.max_luminance_ = brightest * map->scale;
  map->row_guide.resize(Map::guides_of(map->rows));
  make_guide(map->row_cdf.data(), map->rows, map->row_guide);
  // E[L^2] / E[L]^2 - 1 over the sphere.
  double total = 0;
  for (const double w : row_weights) total += w;
  e.variation_ += static_cast<float>(std::max(0.0, squares * 4 * std::numbers::pi / (total * total) - 1));
  e.map_ = std::move(map);
  return e;
}

Spectrum Environment::radiance(Vec3 d) const {
  if (!map_) return mean_radiance_;
  const Map& map = *map_;
  double x = 0;
  double y = 0;
  map.locate(d, x, y);
  if (!(x > -1e9 && x < 1e9 && y >= 0)) return {};  // a direction that is none
  const double fx = std::floor(x);
  const std::uint32_t c = map.column_of(fx);
  const std::uint32_t next = c + 1 == map.columns ? 0 : c + 1;
  const std::uint32_t r = std::min(static_cast<std::uint32_t>(y), map.rows - 1);
  const auto wx = static_cast<float>(x - fx);
  const auto wy = static_cast<float>(std::min(1.0, y - r));
  const TexelImage& image = *map.image;
  const Spectrum top = image.at(c, r) * (1 - wx) + image.at(next, r) * wx;
  const Spectrum bottom = image.at(c, r + 1) * (1 - wx) + image.at(next, r + 1) * wx;
  return (top * (1 - wy) + bottom * wy) * map.scale;
}

float Environment::pdf_solid_angle(Vec3 d) const {
  if (black()) return 0;
  if (!map_) return warp::kPdfUniformSphereSolidAngle;
  const Map& map = *map_;
  double x = 0;
  double y = 0;
  map.locate(d, x, y);
  if (!(x > -1e9 && x < 1e9 && y >= 0)) return 0;
  const std::uint32_t c = map.column_of(std::floor(x));
  const std::uint32_t r = std::min(static_cast<std::uint32_t>(y), map.rows - 1);
  const float* cells = map.cells_of(r);
  return (map.row_cdf[r + 1] - map.row_cdf[r]) * (cells[c + 1] - cells[c]) / map.cell_solid_angle(r);
}

bool Environment::sample(Vec2 u, Vec3& d, float& pdf) const {
  if (black()) return false;
  if (!map_) {
    d = warp::uniform_sphere(u);
    pdf = warp::kPdfUniformSphereSolidAngle;
    return true;
  }
  const Map& map = *map_;
  const std::uint32_t r =
      find_guided(map.row_cdf.data(), map.rows, map.row_guide.data(), Map::guides_of(map.rows), u.y);
  const float* cells = map.cells_of(r);
  const std::uint32_t c = find_guided(cells, map.columns, map.guide_of(r), Map::guides_of(map.columns), u.x);
  const float row_prob = map.row_cdf[r + 1] - map.row_cdf[r];
  const float cell_prob = cells[c + 1] - cells[c];
  if (!(row_prob > 0) || !(cell_prob > 0)) return false;
  const float v = std::clamp((u.y - map.row_cdf[r]) / row_prob, 0.0f, 1.0f);
  const float w = std::clamp((u.x - cells[c]) / cell_prob, 0.0f, 1.0f);
  const double cos_theta = map.edge_cos[r] + (map.edge_cos[r + 1] - map.edge_cos[r]) * v;
  const auto sin_theta = static_cast<float>(std::sqrt(std::max(0.0, (1 - cos_theta) * (1 + cos_theta))));
  const float phi = (static_cast<float>(c) + 0.5f + w) * (2 * math::kPi / static_cast<float>(map.columns));
  float s = 0;
  float co = 0;
  math::sincosf(phi, s, co);
  d = map.to_world.to_world({s * sin_theta, static_cast<float>(cos_theta), -co * sin_theta});
  d = normalize(d);
  pdf = row_prob * cell_prob / map.cell_solid_angle(r);
  return true;
}

float Environment::pdf_direct_solid_angle(Vec3 front, Vec3 d) const {
  if (map_ || is_zero(front) || black()) return pdf_solid_angle(d);
  return warp::pdf_cosine_hemisphere_solid_angle(dot(front, d));
}

DirectOutcome Environment::sample_direct(const SurfaceHit& reference, Vec3 front, double /*rest*/, Vec2 u,
                                         DirectSample& out) const {
  float pdf = 0;
  if (!map_ && !is_zero(front) && !black()) {
    out.wi = make_frame(front).to_world(warp::cosine_hemisphere(u));
    pdf = pdf_direct_solid_angle(front, out.wi);
  } else if (!sample(u, out.wi, pdf)) {
    return DirectOutcome::failed;
  }
  if (!(pdf > 0)) return DirectOutcome::failed;
  out.infinite = true;
  out.delta = false;
  out.ng = {};
  out.pdf_solid_angle = pdf;
  out.shadow_ray = spawn_ray(reference, out.wi);
  if (!faces(front, out.wi)) {
    out.radiance = {};
    return DirectOutcome::dark;
  }
  out.radiance = radiance(out.wi);  // not before: texels of a large map are far apart in memory
  return out.radiance.is_black() ? DirectOutcome::dark : DirectOutcome::sampled;
}

bool Environment::sample_emission(const SceneExtent& scene, double /*rest*/, Vec2 u_position,
                                  Vec2 u_direction, EmissionSample& out) const {
  Vec3 to_light;
  float pdf = 0;
  if (!sample(u_direction, to_light, pdf) || !(pdf > 0)) return false;
  out.radiance = radiance(to_light);
  pdf_emission(scene, {}, -to_light, out);  // 0 by rounding at the edge of a cell: the caller looks
  scene.start_outside(-to_light, u_position, out);
  return true;
}

bool Environment::pdf_emission(const SceneExtent& scene, Vec3 /*ng*/, Vec3 d, EmissionDensity& out) const {
  out.cosine = 1;
  out.infinite = true;
  out.pdf_area = scene.pdf_disk_area();
  out.pdf_solid_angle = pdf_solid_angle(-d);
  return out.prob > 0 && out.pdf_solid_angle > 0;
}

}  // namespace candela::scene
