#include "worker/scene/sensors/sensor.h"

#include <cmath>
#include <numbers>

#include "common/description/film_window.h"
#include "worker/core/math.h"
#include "worker/core/measure.h"
#include "worker/scene/sensors/field_of_view.h"
#include "worker/scene/shapes/shape.h"
#include "worker/scene/transform.h"

namespace candela::scene {
namespace {

Error error_at(const description::Object& object, std::string_view field, std::string message) {
  return input_error(std::move(message))
      .at(object.where.file, object.where.line)
      .with_field(std::string(field));
}

constexpr double kPi = std::numbers::pi;
constexpr double kFarthest = 1e18;  // as of shapes
constexpr const char* kOutOfRange =
    "rays of the camera would begin beyond 1e18 in the scene: its place, near_clip, aperture_radius or "
    "extent is too large";

}  // namespace

Result<Sensor> Sensor::build(const description::Object& sensor, std::uint32_t film_width,
                             std::uint32_t film_height, const std::optional<Crop>& crop) {
  const bool thinlens = sensor.plugin == "thinlens", orthographic = sensor.plugin == "orthographic";
  if (sensor.plugin != "perspective" && !thinlens && !orthographic) {
    return input_error("sensor '" + sensor.plugin +
                       "' is not supported yet (perspective, thinlens and orthographic are)")
        .at(sensor.where.file, sensor.where.line);
  }
  if (film_width == 0 || film_height == 0) return usage_error("the film has no pixels").with_field("size");
  // The whole film in pixels of the image, which is a window of it, and the window's corner on it.
  const auto films = sensor.children_of("film");
  const description::FilmWindow window =
      films.empty() ? description::FilmWindow() : description::film_window(*films[0]);
  const std::uint32_t window_width = crop ? crop->whole_width : film_width,
                      window_height = crop ? crop->whole_height : film_height;
  const double width = window_width *
                       (static_cast<double>(window.film_width) / static_cast<double>(window.width)),
               height = window_height *
                        (static_cast<double>(window.film_height) / static_cast<double>(window.height));
  const double left = width * (static_cast<double>(window.x) / static_cast<double>(window.film_width)) +
                      (crop ? crop->x : 0),
               top = height * (static_cast<double>(window.y) / static_cast<double>(window.film_height)) +
                     (crop ? crop->y : 0);
  const double aspect = width / height;

  Sensor out;
  out.width_ = film_width;
  out.height_ = film_height;
  out.near_clip_ = sensor.get_number("near_clip", 1e-2);
  out.far_clip_ = sensor.get_number("far_clip", 1e4);
  if (!(out.near_clip_ > 0)) return error_at(sensor, "near_clip", "near_clip must be above 0");
  if (!(out.far_clip_ > out.near_clip_))
    return error_at(sensor, "far_clip", "far_clip must be beyond near_clip");

  const Transform to_world(sensor.get_transform("to_world"));
  if (orthographic) {
    // The film spans [-1, 1] across and the same scale down; to_world scales it.
    const double l = length(to_world.column(2));
    const Vec3d x = to_world.column(0), y = to_world.column(1);
    out.kind_ = Kind::orthographic;
    out.direction_ = to_world.column(2) / l;
    out.axis_ = to_world.point({1, 1 / aspect, out.near_clip_});
    out.across_ = x * (-2 / width);
    out.down_ = y * (-2 / aspect / height);
    if (left != 0 || top != 0) out.axis_ += out.across_ * left + out.down_ * top;
    const double volume = std::abs(dot(cross(x, y), out.direction_));
    if (!(volume > 1e-6 * length(x) * length(y)) || !std::isfinite(volume) ||
        !std::isfinite(1 / (volume / (width * width)))) {
      return error_at(sensor, "to_world", "the to_world of an orthographic camera flattens its view");
    }
    out.finish();
    if (!out.in_range()) return error_at(sensor, "to_world", kOutOfRange);
    return out;
  }

  CANDELA_ASSIGN(const double half, half_width_at_unit_depth(sensor, aspect));
  // Mitsuba refuses scale too: distances of the clip planes would have no meaning. Mirrors are fine.
  for (int i = 0; i < 3; ++i) {
    if (std::abs(length(to_world.column(i)) - 1) > 1e-3) {
      return error_at(sensor, "to_world", "a camera's to_world must not scale")
          .with_mend("use lookat, or rotations and a translation alone");
    }
  }
  // Film position f in [0, 1]^2 is the direction ((1 - 2 f_x) half, (1 - 2 f_y) half / aspect, 1); the
  // principal point's offset moves f.
  const double offset_x = sensor.get_number("principal_point_offset_x", 0);
  const double offset_y = sensor.get_number("principal_point_offset_y", 0);
  const Vec3d x = normalize(to_world.column(0)), y = normalize(to_world.column(1)),
              z = normalize(to_world.column(2));
  if (!(std::abs(dot(cross(x, y), z)) > 0.1))
    return error_at(sensor, "to_world", "a camera's to_world must not shear");
  out.origin_ = to_world.translation();
  out.axis_ = z + x * (half * (1 - 2 * offset_x)) + y * (half / aspect * (1 - 2 * offset_y));
  out.across_ = x * (-2 * half / width);
  out.down_ = y * (-2 * half / aspect / height);
  if (left != 0 || top != 0) out.axis_ += out.across_ * left + out.down_ * top;
  if (thinlens) {
    const double radius = sensor.get_number("aperture_radius", 0);
    const double focus = sensor.get_number("focus_distance", out.far_clip_);
    if (!(radius >= 0) || !std::isfinite(radius))
      return error_at(sensor, "aperture_radius", "aperture_radius must not be negative");
    if (!(focus > 0)) return error_at(sensor, "focus_distance", "focus_distance must be above 0");
    if (radius > 0) {
      out.kind_ = Kind::thinlens;
      out.lens_x_ = x * radius;
      out.lens_y_ = y * radius;
      out.inverse_focus_ = 1 / focus;
    }
  }
  out.finish();
  if (!out.in_range()) return error_at(sensor, "to_world", kOutOfRange);
  return out;
}

Result<Sensor> Sensor::build_distant(const description::Object& sensor, const description::FileSource& files,
                                     const Bounds& scene, std::uint32_t film_width,
                                     std::uint32_t film_height) {
  if (film_width != 1 || film_height != 1)
    return error_at(sensor, "film", "the film of a distant sensor has one pixel")
        .with_mend("set its size to 1 x 1");
  Sensor out;
  out.kind_ = Kind::distant;
  const Transform to_world(sensor.get_transform("to_world"));
  const description::Vec3 given = sensor.get_vec3("direction", {0, 0, 1});
  const Vec3d along =
      sensor.find("direction") != nullptr ? Vec3d{given[0], given[1], given[2]} : to_world.vector({0, 0, 1});
  if (!(length(along) > 0)) return error_at(sensor, "direction", "direction has no length");
  out.direction_ = normalize(along);
  const Vec3d center = scene.empty() ? Vec3d{} : scene.center();
  const double radius = scene.empty() ? 1.0 : std::max(scene.radius(), 1e-4) * (1 + 1e-4);
  if (sensor.find("target") != nullptr) {
    const description::Vec3 p = sensor.get_vec3("target", {0, 0, 0});
    out.origin_ = {p[0], p[1], p[2]};
  } else if (const auto targets = sensor.children_of("shape"); !targets.empty()) {
    CANDELA_ASSIGN(const Shape target, build_shape(*targets[0], files));
    if (target.rectangle) {
      out.lens_x_ = Vec3d(target.rectangle->edge_u) * 0.5;
      out.lens_y_ = Vec3d(target.rectangle->edge_v) * 0.5;
      out.origin_ = Vec3d(target.rectangle->corner) + out.lens_x_ + out.lens_y_;
    } else if (target.disk) {
      out.round_ = true;
      out.lens_x_ = target.disk->axes[0] * target.disk->radius;
      out.lens_y_ = target.disk->axes[1] * target.disk->radius;
      out.origin_ = target.disk->center;
    } else {
      return error_at(sensor, "target",
                      "the target is a point, a rectangle or a disk, not a '" + targets[0]->plugin + "'");
    }
  } else {
    const Frame across = make_frame(Vec3(out.direction_));
    out.round_ = true;
    out.lens_x_ = Vec3d(across.s) * radius;
    out.lens_y_ = Vec3d(across.t) * radius;
    out.origin_ = center;
  }
  const Vec3d normal = cross(out.lens_x_, out.lens_y_);
  const double volume = dot(normal, out.direction_);
  if (length(normal) > 0) {
    if (!(std::abs(volume) > 1e-6 * length(normal)))
      return error_at(sensor, "target", "the target is seen from its edge");
    out.dual_x_ = cross(out.lens_y_, out.direction_) / volume;
    out.dual_y_ = cross(out.direction_, out.lens_x_) / volume;
    out.dual_depth_ = normal / volume;
  }
  out.pixel_ = std::abs(volume) * (out.round_ ? kPi : 4.0);
  // From far enough for all that lies around the target; the rays go on without end.
  const double back = length(out.origin_ - center) + radius + length(out.lens_x_) + length(out.lens_y_);
  out.origin_ += out.direction_ * -back;
  if (!(length(out.origin_) + length(out.lens_x_) + length(out.lens_y_) <= kFarthest))
    return error_at(sensor, "to_world", kOutOfRange);
  return out;
}

bool Sensor::on_target(Vec3d p, double& depth) const {
  if (!(pixel_ > 0)) return false;
  const Vec3d v = p - origin_;
  const double x = dot(v, dual_x_), y = dot(v, dual_y_);
  depth = dot(v, dual_depth_);
  return round_ ? x * x + y * y <= 1 : std::abs(x) <= 1 && std::abs(y) <= 1;
}

bool Sensor::in_range() const {
  constexpr double kBorder = 64;  // pixels, of the widest filter
  const double film =
      length(axis_) + length(across_) * (width_ + kBorder) + length(down_) * (height_ + kBorder);
  if (kind_ == Kind::orthographic) return film <= kFarthest;
  const double lens = length(lens_x_);
  return length(origin_) + lens + near_clip_ * (film + lens * inverse_focus_) <= kFarthest;
}

void Sensor::finish() {
  const Vec3d depth = kind_ == Kind::orthographic ? direction_ : axis_;
  const Vec3d normal = cross(across_, down_);
  const double det = dot(normal, depth);
  dual_x_ = cross(down_, depth) / det;
  dual_y_ = cross(depth, across_) / det;
  dual_depth_ = normal / det;
  pixel_ = std::abs(det);
  if (kind_ != Kind::orthographic) direction_ = normalize(det < 0 ? -normal : normal);
  lens_area_ = kPi * length(cross(lens_x_, lens_y_));
}

bool Sensor::sample(const SurfaceHit& reference, Vec2 u_lens, float border, CameraSample& out) const {
  out.delta_position = kind_ == Kind::perspective;
  out.delta_direction = kind_ == Kind::orthographic;
  out.ng = Vec3(direction_);
  out.cosine = 1;
  out.pdf_solid_angle = 1;
  const Vec3d p(reference.p);
  if (kind_ == Kind::distant) [[unlikely]] {
    double depth = 0;
    if (!on_target(p, depth) || !(depth > 0)) return false;
    out.delta_direction = true;
    out.wi = Vec3(-direction_);
    out.film_x = out.film_y = 0.5f;
    out.importance = static_cast<float>(1 / pixel_);
    out.p = Vec3(p - direction_ * depth);
    out.shadow_ray = spawn_shadow_ray(reference, out.p, {0, 0, 0}, 0);
    return true;
  }
  if (kind_ == Kind::orthographic) {
    const Vec3d v = p - axis_;
    const double t = dot(v, dual_depth_), x = dot(v, dual_x_), y = dot(v, dual_y_);
    if (!(t > 0 && t <= far_clip_ - near_clip_) || !on_film(x, y, border)) return false;
    out.wi = Vec3(-direction_);
    out.film_x = static_cast<float>(x);
    out.film_y = static_cast<float>(y);
    out.importance = static_cast<float>(1 / pixel_);
    const Vec3d target = p - direction_ * t;
    out.p = Vec3(target);
    out.shadow_ray = spawn_shadow_ray(reference, out.p, {0, 0, 0}, 0);
    return true;
  }
  const Vec3d lens = kind_ == Kind::thinlens ? lens_point(u_lens) : Vec3d{};
  const Vec3d v = p - (origin_ + lens);
  const double depth = dot(v, dual_depth_);
  if (!(depth >= near_clip_ && depth <= far_clip_)) return false;
  const Vec3d w = v / depth;  // to the plane at unit depth
  const Vec3d on_plane = w + lens * inverse_focus_;
  const double x = dot(on_plane, dual_x_), y = dot(on_plane, dual_y_);
  if (!on_film(x, y, border)) return false;
  const double distance_squared = length_squared(v), distance = std::sqrt(distance_squared);
  const double cosine = dot(v, direction_) / distance;
  // d(film) / d(solid angle) from the lens point: a pixel at unit depth spans det(across, down, w) / |w|^3.
  const double l = distance / depth, jacobian = unit_plane_to_solid_angle(pixel_, l * l * l);
  out.wi = Vec3(v / -distance);
  out.p = Vec3(origin_ + lens);
  out.cosine = static_cast<float>(cosine);
  out.film_x = static_cast<float>(x);
  out.film_y = static_cast<float>(y);
  if (kind_ == Kind::thinlens) {
    out.importance = static_cast<float>(jacobian / (lens_area_ * cosine));
    out.pdf_solid_angle = static_cast<float>(area_to_solid_angle(1.0, distance_squared, cosine * lens_area_));
  } else {
    out.importance = static_cast<float>(jacobian / distance_squared);
  }
  out.shadow_ray = spawn_shadow_ray(reference, Vec3(origin_ + lens + w * near_clip_), {0, 0, 0}, 0);
  return std::isfinite(out.importance) && std::isfinite(out.pdf_solid_angle);
}

bool Sensor::density(Vec3 point, Vec3 direction, float border, CameraDensity& out) const {
  out.delta_position = kind_ == Kind::perspective;
  out.delta_direction = kind_ == Kind::orthographic;
  const double film_area = width_ * height_;
  if (kind_ == Kind::distant) [[unlikely]] {
    double depth = 0;
    if (!on_target(Vec3d(point), depth)) return false;
    out.delta_direction = true;
    out.p = Vec3(Vec3d(point) - direction_ * depth);
    out.film_x = out.film_y = 0.5f;
    out.pdf_area = out.importance = static_cast<float>(1 / pixel_);
    out.pdf_solid_angle = 1;
    out.cosine = 1;
    return true;
  }
  if (kind_ == Kind::orthographic) {
    const Vec3d v = Vec3d(point) - axis_;
    const double x = dot(v, dual_x_), y = dot(v, dual_y_);
    if (!on_film(x, y, border)) return false;
    out.p = Vec3(Vec3d(point) - direction_ * dot(v, dual_depth_));
    out.film_x = static_cast<float>(x);
    out.film_y = static_cast<float>(y);
    out.pdf_area = static_cast<float>(1 / (pixel_ * film_area));
    out.pdf_solid_angle = 1;
    out.importance = static_cast<float>(1 / pixel_);
    out.cosine = 1;
    return true;
  }
  const Vec3d d(direction);
  const double depth = dot(d, dual_depth_);
  if (!(depth > 0)) return false;
  const Vec3d w = d / depth;
  Vec3d on_plane = w;
  out.p = Vec3(origin_);
  out.pdf_area = 1;
  double lens_pdf = 1;
  const double length_squared_d = length_squared(d);
  const double cosine = dot(d, direction_) / std::sqrt(length_squared_d);
  if (kind_ == Kind::thinlens) {
    const Vec3d to_point = Vec3d(point) - origin_;
    const Vec3d lens = to_point - w * dot(to_point, dual_depth_);
    // Within the lens, its rim included: a point sampled there has been rounded.
    const double radius_squared = length_squared(lens_x_);
    if (!(length_squared(lens) <= radius_squared * (1 + 1e-5))) return false;
    on_plane += lens * inverse_focus_;
    out.p = Vec3(origin_ + lens);
    lens_pdf = 1 / lens_area_;
    out.pdf_area = static_cast<float>(lens_pdf);
  }
  const double x = dot(on_plane, dual_x_), y = dot(on_plane, dual_y_);
  if (!on_film(x, y, border)) return false;
  const double l_squared = length_squared(w);
  const double jacobian = unit_plane_to_solid_angle(pixel_, l_squared * std::sqrt(l_squared));
  out.film_x = static_cast<float>(x);
  out.film_y = static_cast<float>(y);
  out.pdf_solid_angle = static_cast<float>(jacobian / film_area);
  out.importance = static_cast<float>(kind_ == Kind::thinlens ? jacobian * lens_pdf / cosine : jacobian);
  out.cosine = static_cast<float>(cosine);
  return std::isfinite(out.pdf_solid_angle) && std::isfinite(out.importance);
}

bool Sensor::intersect(const Ray& ray, float border, float& distance, CameraDensity& out) const {
  if (kind_ != Kind::thinlens) return false;
  const Vec3d d(ray.direction);
  const double approach = -dot(d, dual_depth_);
  if (!(approach > 0)) return false;
  const double depth = dot(Vec3d(ray.origin) - origin_, dual_depth_);
  const double t = (depth - near_clip_) / approach;
  if (!(depth >= near_clip_ && depth <= far_clip_) || !(t <= static_cast<double>(ray.t_max))) return false;
  if (!density(ray.origin, -ray.direction, border, out)) return false;
  distance = static_cast<float>(t);
  return true;
}

}  // namespace candela::scene
